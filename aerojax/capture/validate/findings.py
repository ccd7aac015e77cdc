"""Typed look-ups in untrusted JSON that collect every problem instead of stopping at the first."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from aerojax.core.errors import UserError


@dataclass(frozen=True)
class Problem:
    """One thing wrong with a capture.

    file: path inside the capture's folder.
    field: JSON path such as `cameras[1].K`; empty where the whole file is meant.
    message: what is wrong.
    remedy: what the user can do about it.
    """

    file: str
    field: str
    message: str
    remedy: str

    def __str__(self) -> str:
        where = f"{self.file}: {self.field}" if self.field else self.file
        return f"{where}: {self.message} ({self.remedy})"


def refuse(problems: Sequence[Problem], what: str) -> None:
    """End with everything that is wrong at once; nothing happens where nothing is.

    Args:
        what: whose problems they are, such as "capture /data/morning".

    Raises:
        UserError: lists the problems, one a line.
    """
    if problems:
        lines = "\n".join(f"  {problem}" for problem in problems)
        count = f"{len(problems)} problem{'s' if len(problems) > 1 else ''}"
        raise UserError("invalid", f"{what} has {count}:\n{lines}")


def is_finite_number(value: Any) -> bool:
    """Whether a JSON value is a finite number; booleans are none."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # an integer beyond the range of float
        return False


def shown(value: Any) -> str:
    """A value of the user's file, short enough for a message."""
    text = ascii(value)
    return text if len(text) <= 60 else text[:57] + "..."


@dataclass(frozen=True)
class Clock:
    """What the files are checked against.

    fps, frames: of the capture; None (itself a problem) skips what depends on it.
    refuse: whether missing and damaged files are problems; otherwise they are warnings, unless there are no others.
    outside: whether files may lie outside of the capture's folder.
    """

    fps: float | None
    frames: int | None
    refuse: bool
    outside: bool = False


def size_problem(width: int, height: int, camera: dict[str, Any]) -> str | None:
    """What is wrong with the size of an image or a video, or None."""
    wanted = camera.get("width"), camera.get("height")
    if all(isinstance(side, int) for side in wanted) and wanted != (width, height):
        return f"is {width}×{height} pixels, the camera {wanted[0]}×{wanted[1]}"
    return None


class Findings:
    """Collects problems of one JSON file; every look-up returns the value or None where a problem was noted."""

    def __init__(self, file: str) -> None:
        self.file = file
        self.problems: list[Problem] = []
        self.warnings: list[Problem] = []

    def add(self, field: str, message: str, remedy: str, *, file: str | None = None) -> None:
        """Note a problem of `field` in this file, or in another file of the capture."""
        self.problems.append(Problem(file or self.file, field, message, remedy))

    def warn(self, field: str, message: str, remedy: str, *, file: str | None = None) -> None:
        """Note what is worth knowing and keeps nothing from being used."""
        self.warnings.append(Problem(file or self.file, field, message, remedy))

    def mapping(
        self, value: Any, field: str, required: Iterable[str], optional: Iterable[str] = ()
    ) -> dict[str, Any] | None:
        """A JSON object with all `required` keys and none beyond those and the `optional` ones.

        Unknown and missing keys are noted and the object returned all the same, so that its other keys are checked.
        """
        if not isinstance(value, dict):
            self.add(field, f"must be an object, is {shown(value)}", "write { … } here")
            return None
        prefix = f"{field}." if field else ""
        required, known = list(required), [*required, *optional]
        for key in sorted(set(value) - set(known)):
            self.add(f"{prefix}{shown(key)[1:-1]}", "unknown key", f"known keys are {', '.join(known)}")
        for key in required:
            if key not in value:
                self.add(prefix + key, "is missing", "add the key")
        return value

    def items(self, value: Any, field: str) -> list[Any]:
        """A JSON array; empty where it is none."""
        if isinstance(value, list):
            return value
        self.add(field, f"must be a list, is {shown(value)}", "write [ … ] here")
        return []

    def number(self, value: Any, field: str) -> float | None:
        """A finite number."""
        if is_finite_number(value):
            return float(value)
        self.add(field, f"must be a finite number, is {shown(value)}", "write a number without quotes")
        return None

    def whole(self, value: Any, field: str, low: int, high: int) -> int | None:
        """A whole number from `low` to `high`."""
        if isinstance(value, int) and not isinstance(value, bool) and low <= value <= high:
            return value
        self.add(field, f"must be a whole number from {low} to {high}, is {shown(value)}", "correct the number")
        return None

    def text(self, value: Any, field: str) -> str | None:
        """A non-empty printable string of at most 200 characters."""
        if isinstance(value, str) and 0 < len(value) <= 200 and value.isprintable():
            return value
        self.add(field, f"must be a printable string of 1 to 200 characters, is {shown(value)}", "correct the text")
        return None

    def numbers(self, value: Any, field: str, count: int) -> list[float] | None:
        """A list of `count` finite numbers."""
        if isinstance(value, list) and len(value) == count and all(is_finite_number(v) for v in value):
            return [float(v) for v in value]
        self.add(field, f"must be a list of {count} finite numbers, is {shown(value)}", "correct the list")
        return None

    def matrix(self, value: Any, field: str, size: int) -> np.ndarray | None:
        """A `size`×`size` matrix of finite numbers, a list of rows."""
        square = isinstance(value, list) and len(value) == size
        square = square and all(isinstance(row, list) and len(row) == size for row in value)
        if not square:
            self.add(field, f"must be {size} rows of {size} numbers, is {shown(value)}", "write the matrix row by row")
            return None
        if not all(is_finite_number(v) for row in value for v in row):
            self.add(field, "has an entry that is no finite number (NaN, infinity or text)", "recompute the matrix")
            return None
        return np.array(value, dtype=np.float64)
