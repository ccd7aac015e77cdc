"""Cells and tables of Markdown that figures are written in."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence


def table_lines(head: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Lines of a table."""
    lines = ["| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    return [*lines, *("| " + " | ".join(row) + " |" for row in rows)]


def mean_cell(figure: Mapping[str, float | None], *, missing: str = "-") -> str:
    """Percent of a share with its deviation over seeds (0..1, as `ablation.over_seeds` gives them)."""
    mean, std = figure["mean"], figure["std"]
    return missing if mean is None else f"{100 * mean:.1f}" + ("" if std is None else f" ± {100 * std:.1f}")


def interval_cell(low: float, high: float, how: str = ".1f") -> str:
    """Percent of the ends of an interval (0..1) in brackets, written as the format says."""
    return f"({100 * low:{how}} to {100 * high:{how}})"
