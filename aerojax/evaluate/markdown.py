"""Cells and tables of Markdown that figures are written in."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Literal


def table_lines(head: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Lines of a table."""
    lines = ["| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    return [*lines, *("| " + " | ".join(row) + " |" for row in rows)]


def mean_cell(figure: Mapping[str, float | None]) -> str:
    """Percent of a share with its deviation over seeds (0..1, as `ablation.over_seeds` gives them)."""
    mean, std = figure["mean"], figure["std"]
    return "-" if mean is None else f"{100 * mean:.1f}" + ("" if std is None else f" ± {100 * std:.1f}")


def interval_cell(low: float, high: float, *, sign: Literal["", "+"] = "") -> str:
    """Percent of the ends of an interval (0..1) in brackets."""
    return f"({100 * low:{sign}.1f} to {100 * high:{sign}.1f})"
