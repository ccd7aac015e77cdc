"""What lies behind an object that never leaves its place, guessed from what lies around it."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Bool, Float32, UInt8

from aerojax.segment.voxel_vote.background import GREATEST_DEVIATION

GUESSED = 0.02
"""Standard deviation of what the surroundings continue, sRGB, at least."""
GAP_PX = 64
"""Pixels across a gap and its surroundings, in which they are continued; larger ones are reduced."""
DIRECTIONS = 16
"""Of the lines through a gap."""
ALIKE = 0.01
"""Difference of what a line meets on both sides of a gap, sRGB, below which smaller ones tell nothing."""
ONE_SIDED = 0.22
"""Difference, sRGB, that a line counts with which ends in the gap or leaves the image there."""
ENDLESS = 10.0
"""The same of a line that meets nothing known: only where no other line does is it asked."""
DOUBTED = 2.0
"""Deviations between lines that a pixel may be off: in validation backgrounds 0.8 % are by more than 2.5 times that."""
BESIDE_PX = 2.0
"""Standard deviation of the neighbourhood whose lines are judged together."""


def continue_surroundings(
    mean: Float32[np.ndarray, "height width 3"],
    variance: Float32[np.ndarray, "height width"],
    unseen: UInt8[np.ndarray, "height width"],
) -> None:
    """Put the surroundings' colours where nothing was seen, in place, and how far they may be wrong.

    Edges of fields, horizons and roofs are straight: they go on through a gap where the same is seen on its other side.
    """
    count, _, stats, _ = cv2.connectedComponentsWithStats(unseen, connectivity=8)
    for x, y, columns, rows, _ in stats[1:count]:
        reach = int(max(columns, rows))
        window = np.s_[max(y - reach, 0) : y + rows + reach, max(x - reach, 0) : x + columns + reach]
        gap = unseen[window] > 0
        if gap.all():
            continue
        guess, doubt = _continued(mean[window], gap)
        mean[window][gap] = guess[gap]
        variance[window][gap] = np.clip(doubt[gap], GUESSED**2, GREATEST_DEVIATION**2)


def _continued(
    mean: Float32[np.ndarray, "rows columns 3"], gap: Bool[np.ndarray, "rows columns"]
) -> tuple[Float32[np.ndarray, "rows columns 3"], Float32[np.ndarray, "rows columns"]]:
    """Means of what lines through a gap meet on its two sides, those that meet the same far ahead of the others.

    Returns:
        And how far a pixel may be off, squared: by `DOUBTED` deviations between its lines, of the channel in which they
        differ most.
    """
    scale = max(1.0, max(gap.shape) / (3 * GAP_PX))
    size = max(1, round(gap.shape[1] / scale)), max(1, round(gap.shape[0] / scale))
    image = cv2.resize(mean, size, interpolation=cv2.INTER_AREA)
    hole = cv2.resize(gap.astype(np.float32), size, interpolation=cv2.INTER_AREA) > 0
    near = _blurred(hole.astype(np.float32))
    total, squares = np.zeros_like(image), np.zeros_like(image)
    weights = np.zeros(hole.shape, np.float32)
    for turn in np.arange(DIRECTIONS) * (np.pi / DIRECTIONS):
        value, unlike, apart = _along_lines(image, hole, turn)
        unlike = _blurred(unlike * hole) / np.maximum(near, np.float32(1e-6))
        weight = 1 / (np.maximum(apart, 1) * (unlike + np.float32(ALIKE**2)) ** 2)
        total += weight[..., None] * value
        squares += weight[..., None] * value * value
        weights += weight
    guess = total / weights[..., None]
    doubt = np.float32(DOUBTED**2) * (squares / weights[..., None] - guess * guess).max(axis=-1)
    return cv2.resize(guess, gap.shape[::-1]), cv2.resize(doubt, gap.shape[::-1])


def _blurred(values: Float32[np.ndarray, "rows columns"]) -> Float32[np.ndarray, "rows columns"]:
    return cv2.GaussianBlur(values, (0, 0), BESIDE_PX)


def _along_lines(
    image: Float32[np.ndarray, "rows columns 3"], hole: Bool[np.ndarray, "rows columns"], turn: float
) -> tuple[
    Float32[np.ndarray, "rows columns 3"], Float32[np.ndarray, "rows columns"], Float32[np.ndarray, "rows columns"]
]:
    """What is known, continued along lines at one angle.

    Returns:
        Values between those at the ends of a pixel's line, the squared difference of these, and their distance, pixels.
    """
    rows, columns = hole.shape
    side = int(np.hypot(rows, columns)) + 3
    turned = cv2.getRotationMatrix2D(((columns - 1) / 2, (rows - 1) / 2), np.degrees(turn), 1.0)
    turned[:, 2] += (side - columns) / 2, (side - rows) / 2
    seen = cv2.warpAffine((~hole).astype(np.float32), turned, (side, side)) > 0.999
    colours = cv2.warpAffine(np.where(hole[..., None], np.float32(0), image), turned, (side, side))
    place = np.arange(side)
    left = np.maximum.accumulate(np.where(seen, place, -1), axis=1)
    right = np.minimum.accumulate(np.where(seen, place, side)[:, ::-1], axis=1)[:, ::-1]
    first, last = (colours[place[:, None], np.clip(end, 0, side - 1)] for end in (left, right))
    apart = (right - left).astype(np.float32)
    share = np.where(left < 0, 1, np.where(right == side, 0, (place - left) / np.maximum(apart, 1)))[..., None]
    value = (first + share.astype(np.float32) * (last - first)).astype(np.float32)
    ends = (left >= 0).astype(int) + (right < side)
    unlike = np.choose(ends, [np.float32(ENDLESS**2), np.float32(ONE_SIDED**2), np.square(last - first).max(axis=-1)])
    back = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    value, unlike, apart = (cv2.warpAffine(one, turned, (columns, rows), flags=back) for one in (value, unlike, apart))
    return value, unlike, apart
