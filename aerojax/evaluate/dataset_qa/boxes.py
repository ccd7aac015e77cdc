"""Boxes of many silhouettes, pixels, x0 y0 x1 y1, ends exclusive: to a fraction of a pixel, and how well two agree."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

NOWHERE = (np.nan, np.nan, np.nan, np.nan)
"""A box that does not exist."""


def subpixel_box(coverage: Float[np.ndarray, "rows columns"]) -> Float[np.ndarray, "4"]:
    """Box around a silhouette to a fraction of a pixel, from how much of each pixel it covers; NaN where it is empty.

    An outermost pixel that is covered half as much as its inner neighbours is reached half, whether the silhouette is
    wide there (1 and 0.5) or thin (0.3 and 0.15). Where there is no inner neighbour the whole pixel counts.
    """
    if not (coverage > 0).any():
        return np.array(NOWHERE)
    rows, columns = coverage.shape
    left, right = _first_edge(coverage), columns - _first_edge(coverage[:, ::-1])
    top, bottom = _first_edge(coverage.T), rows - _first_edge(coverage.T[:, ::-1])
    return np.array((left, top, right, bottom))


def _first_edge(coverage: np.ndarray) -> float:
    """Where the silhouette begins along the columns."""
    column = int(np.argmax((coverage > 0).any(axis=0)))
    if column + 1 == coverage.shape[1]:
        return float(column)
    behind = np.pad(coverage[:, column + 1].astype(np.float64), 1)
    inner = np.maximum(np.maximum(behind[:-2], behind[1:-1]), behind[2:])  # slanted parts go on in the next row
    here = coverage[:, column].astype(np.float64)
    reached = np.where(inner > 0, here / np.where(inner > 0, inner, 1.0), 1.0)[here > 0]
    return column + 1.0 - float(min(1.0, reached.max()))


def clip_boxes(boxes: Float[np.ndarray, "view 4"], size: Float[np.ndarray, "view 2"]) -> Float[np.ndarray, "view 4"]:
    """The parts of boxes inside images of a size (width, height)."""
    return np.clip(boxes, 0.0, np.concatenate([size, size], axis=1))


def box_overlaps(one: Float[np.ndarray, "view 4"], other: Float[np.ndarray, "view 4"]) -> Float[np.ndarray, "view"]:
    """Intersection over union; 0 where the boxes do not meet, NaN where one does not exist or has no area."""
    inner = np.minimum(one[:, 2:], other[:, 2:]) - np.maximum(one[:, :2], other[:, :2])
    shared = inner.clip(0.0).prod(axis=1)
    areas = [(box[:, 2:] - box[:, :2]).clip(0.0).prod(axis=1) for box in (one, other)]
    exists = (areas[0] > 0) & (areas[1] > 0)
    return np.where(exists, shared / np.where(exists, areas[0] + areas[1] - shared, 1.0), np.nan)
