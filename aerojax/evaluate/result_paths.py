"""Paths into results: `rows[factor=clock_ms,value=66].accuracy`.

A path is keys and numbers with dots between, `*` for all that go on as the path does, `[key=value,…]` for the one row
that says so, and min(…), max(…), median(…), sum(…) or count(…) around it.
"""

from __future__ import annotations

import re
import statistics
from collections.abc import Callable, Sequence
from typing import Any

_REDUCED = re.compile(r"(min|max|median|sum|count)\((.*)\)")
_STEP = re.compile(r"([^.\[\]]+)|\[([^\]]*)\]")
_REDUCERS: dict[str, Callable[[Any], Any]] = {
    "min": min,
    "max": max,
    "median": statistics.median,
    "sum": sum,
    "count": len,
}


class NoSuchRowError(KeyError):
    """No row says what a path asks for; of a sweep that is not over, for instance."""


def lookup(values: Any, path: str) -> Any:
    """What a path leads to; see the top of this file.

    Raises:
        NoSuchRowError: no row fits.
        KeyError: a key is not there, or several rows fit.
        IndexError: a list is shorter.
    """
    if reduced := _REDUCED.fullmatch(path):
        return _REDUCERS[reduced[1]](lookup(values, reduced[2]))
    return _followed(values, [key or f"[{chosen}]" for key, chosen in _STEP.findall(path)])


def _followed(values: Any, steps: Sequence[str]) -> Any:
    if not steps:
        return values
    step, rest = steps[0], steps[1:]
    if step == "*":
        every = values.values() if isinstance(values, dict) else values
        return [_followed(value, rest) for value in every if not rest or (isinstance(value, dict) and rest[0] in value)]
    if "=" in step:
        wanted = dict(pair.split("=") for pair in step.strip("[]").split(","))
        found = [row for row in values if all(_equal(row[key], value) for key, value in wanted.items())]
        if not found:
            raise NoSuchRowError(f"{step} fits 0 rows")
        if len(found) != 1:
            raise KeyError(f"{step} fits {len(found)} rows")
        return _followed(found[0], rest)
    key = step.strip("[]")
    return _followed(values[int(key)] if isinstance(values, list) else values[key], rest)


def _equal(value: Any, text: str) -> bool:
    return value == float(text) if isinstance(value, int | float) else str(value) == text
