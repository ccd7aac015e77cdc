"""What lies behind an object that never leaves its place, guessed from what lies around it."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Bool, Float32, UInt8

from aerojax.core.colour import as_bytes, as_floats
from aerojax.segment.voxel_vote.background import GREATEST_DEVIATION

GUESSED = 0.02
"""Standard deviation of what the surroundings continue, sRGB, at least."""
GAP_PX = 64
"""Pixels across a gap and its surroundings, in which they are continued; larger ones are reduced."""
REACH_PX = 5
"""Pixels around each one of a gap that it is made of."""


def continue_surroundings(
    mean: Float32[np.ndarray, "height width 3"],
    variance: Float32[np.ndarray, "height width"],
    unseen: UInt8[np.ndarray, "height width"],
) -> None:
    """Put the surroundings' colours where nothing was seen, in place, and how far they may be wrong.

    Inpainting by fast marching (Telea 2004), which lets edges run on a little.
    """
    count, _, stats, _ = cv2.connectedComponentsWithStats(unseen, connectivity=8)
    for x, y, columns, rows, _ in stats[1:count]:
        reach = int(max(columns, rows))
        window = np.s_[max(y - reach, 0) : y + rows + reach, max(x - reach, 0) : x + columns + reach]
        gap = unseen[window] > 0
        if gap.all():
            continue
        guess, doubt = _inpainted(mean[window], gap), _doubt(mean[window], gap)
        mean[window][gap] = guess[gap]
        variance[window][gap] = np.clip(doubt, GUESSED, GREATEST_DEVIATION) ** 2


def _doubt(mean: Float32[np.ndarray, "rows columns 3"], gap: Bool[np.ndarray, "rows columns"]) -> float:
    """How wrong surroundings are that are continued where the truth is known: into gaps of the same shape beside.

    The median of four root mean squares, of the channel that is most wrong; the greatest where nothing is beside.
    """
    rows, columns = np.nonzero(gap)
    high, wide = int(np.ptp(rows)) + 1, int(np.ptp(columns)) + 1
    errors = []
    for down, right in ((0, wide), (0, -wide), (high, 0), (-high, 0)):
        y, x = rows + down, columns + right
        within = (y >= 0) & (x >= 0) & (y < gap.shape[0]) & (x < gap.shape[1])
        beside = np.zeros_like(gap)
        beside[y[within], x[within]] = True
        beside &= ~gap
        if beside.any() and not (gap | beside).all():
            wrong = (_inpainted(mean, gap | beside) - mean)[beside]
            errors.append(float(np.sqrt(np.mean(wrong * wrong, axis=0)).max()))
    return float(np.median(errors)) if errors else GREATEST_DEVIATION


def _inpainted(
    mean: Float32[np.ndarray, "rows columns 3"], gap: Bool[np.ndarray, "rows columns"]
) -> Float32[np.ndarray, "rows columns 3"]:
    scale = max(1.0, max(gap.shape) / (3 * GAP_PX))
    size = max(1, round(gap.shape[1] / scale)), max(1, round(gap.shape[0] / scale))
    image = cv2.resize(as_bytes(mean), size, interpolation=cv2.INTER_AREA)
    hole = (cv2.resize(gap.astype(np.float32), size, interpolation=cv2.INTER_AREA) > 0).astype(np.uint8)
    filled = as_floats(cv2.inpaint(image, hole, REACH_PX, cv2.INPAINT_TELEA))
    return cv2.resize(filled, gap.shape[::-1])
