"""Figures of results/*.json, and how tables and prose write them."""

from __future__ import annotations

import functools
import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from aerojax.evaluate.markdown import mean_cell, table_lines

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
ABSENT = "Not measured yet."
_RAISED = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")


@functools.cache
def load(name: str) -> Any:
    """The content of results/<name>.json, or of docs/<name>.json."""
    path = next(p for p in (ROOT / "results" / f"{name}.json", DOCS / f"{name}.json") if p.is_file())
    return json.loads(path.read_text(encoding="utf-8"))


def measured(name: str) -> bool:
    """Whether there is a results/<name>.json."""
    return (ROOT / "results" / f"{name}.json").is_file()


def formatted(value: Any, how: str) -> str:
    """A value as the page has it."""
    if how.endswith("%"):
        return f"{100 * value:{how[:-1]}f} %"
    if how.endswith("e"):
        number, power = f"{value:{how}}".split("e")
        return f"{number}·10{str(int(power)).translate(_RAISED)}"
    return f"{value:{how}}"


def markdown(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table."""
    return "\n".join(table_lines(head, ([str(cell) for cell in row] for row in rows)))


def percent(share: float, digits: int = 1) -> str:
    """A share as the tables have it."""
    return formatted(share, f".{digits}%")


def spread(figure: dict[str, float | None]) -> str:
    """Mean and deviation over seeds, in %; nothing where there is none."""
    return mean_cell(figure, missing="")
