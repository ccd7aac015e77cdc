"""Pieces of path in one camera's images, without any other camera: what is near where the last images lead."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64
from scipy.optimize import linear_sum_assignment

REACH_PX = 25.0
"""From where a piece leads to its next detection; an object at 60 m with 20 m/s² is off by less in a thirtieth."""
LONGEST_GAP_S = 0.12
"""Between two detections of a piece: a few images."""
FEWEST = 10
"""Detections of a piece; false ones seldom make a row of so many."""


@dataclass
class _Piece:
    """A piece that grows; velocity in pixels a second, zero until there are two detections."""

    rows: list[int]
    pixel: Float64[np.ndarray, "2"]
    velocity: Float64[np.ndarray, "2"]
    stamp_s: float


def tracklets(
    stamp_s: Float64[np.ndarray, "sight"], pixels: Float64[np.ndarray, "sight 2"]
) -> list[Int64[np.ndarray, "piece"]]:
    """Rows of the detections of each piece, in order of time.

    Args:
        stamp_s: of one camera's detections, in any order.
        pixels: of them.
    """
    order = np.argsort(stamp_s, kind="stable")
    images = np.split(order, np.flatnonzero(np.diff(stamp_s[order])) + 1) if len(order) else []
    done: list[_Piece] = []
    growing: list[_Piece] = []
    for rows in images:
        now = float(stamp_s[rows[0]])
        done += [piece for piece in growing if now - piece.stamp_s > LONGEST_GAP_S]
        growing = [piece for piece in growing if now - piece.stamp_s <= LONGEST_GAP_S]
        free = set(rows.tolist())
        for piece, row in _continued(growing, rows, pixels, now):
            _grow(piece, row, pixels[row], now)
            free.discard(row)
        growing += [_Piece([row], pixels[row], np.zeros(2), now) for row in sorted(free)]
    return [np.array(piece.rows, np.int64) for piece in done + growing if len(piece.rows) >= FEWEST]


def _continued(
    growing: list[_Piece], rows: Int64[np.ndarray, "image"], pixels: Float64[np.ndarray, "sight 2"], now: float
) -> list[tuple[_Piece, int]]:
    """Pieces and the detections that go on with them."""
    if not growing:
        return []
    led = np.stack([piece.pixel + (now - piece.stamp_s) * piece.velocity for piece in growing])
    distance = np.linalg.norm(led[:, None] - pixels[rows][None], axis=2)
    pairs = zip(*linear_sum_assignment(np.minimum(distance, REACH_PX)), strict=True)
    return [(growing[i], int(rows[j])) for i, j in pairs if distance[i, j] < REACH_PX]


def _grow(piece: _Piece, row: int, pixel: Float64[np.ndarray, "2"], now: float) -> None:
    fresh = (pixel - piece.pixel) / (now - piece.stamp_s)
    piece.velocity = fresh if len(piece.rows) == 1 else 0.5 * piece.velocity + 0.5 * fresh
    piece.rows.append(row)
    piece.pixel, piece.stamp_s = pixel, now
