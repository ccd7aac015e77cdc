"""Masks as COCO's compressed run lengths."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Bool


def encode_mask(mask: Bool[np.ndarray, "height width"]) -> dict[str, Any]:
    """`{"size": [height, width], "counts": str}` as pycocotools reads it, `counts` being text so that JSON can hold it.

    Runs of 0 and 1 alternate down the columns, starting with 0. From the fourth on a run is written as the difference
    to the one before the last; numbers are split into groups of five bits, lowest first, each a character from "0".
    """
    runs = _runs(mask)
    numbers = [run - runs[i - 2] if i > 2 else run for i, run in enumerate(runs)]
    return {"size": [int(side) for side in mask.shape], "counts": "".join(map(_characters, numbers))}


def _runs(mask: Bool[np.ndarray, "height width"]) -> list[int]:
    columns = np.flatnonzero(mask.any(axis=0))
    if columns.size == 0:
        return [mask.size]
    # Reordering is slow, so only the columns between the first and the last pixel are; beyond them all is 0.
    inner = mask[:, columns[0] : columns[-1] + 1].ravel(order="F")
    padded = np.concatenate([[False], inner, [False]])
    borders = np.flatnonzero(padded[1:] != padded[:-1]) + columns[0] * mask.shape[0]
    runs = np.diff(np.concatenate([[0], borders, [mask.size]])).tolist()
    return runs if runs[-1] > 0 else runs[:-1]


def _characters(number: int) -> str:
    text = ""
    while True:
        group, number = number & 31, number >> 5  # arithmetic shift: a negative number ends in -1
        ends = number == (-1 if group & 16 else 0)
        text += chr(48 + group + (0 if ends else 32))
        if ends:
            return text
