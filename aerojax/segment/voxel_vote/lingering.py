"""Backgrounds behind objects that stay: where one covers a pixel in most frames, their median is the object.

Its rim moves nevertheless, and the cameras agree on it. What all of it covers in a frame says nothing of the background
then; the median is taken of the other frames, and where there are none the surroundings are continued.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
from jaxtyping import Bool, Float32, Int32, UInt8

from aerojax.segment.voxel_vote.background import GREATEST_DEVIATION, Background
from aerojax.segment.voxel_vote.cluster import Region
from aerojax.segment.voxel_vote.registration import coarse

OFTEN = 0.34
"""Share of the frames in which an object covers a pixel, from which on the median is not to be trusted."""
FEWEST = 2
"""Frames without an object whose median is a background."""
GUESSED = 0.02
"""Standard deviation of what the surroundings continue, sRGB."""
WRONG = 0.04
"""Difference of a background, sRGB, from the frames without an object, from which on it shows the object."""
LARGEST = 0.1
"""Of an image; what covers more is no object that flies, and nothing is learnt from it."""
PLAIN = 0.03
"""Standard deviation of the surroundings, sRGB, up to which they are continued into a gap."""
GAP_PX = 24
"""Pixels across a gap whose surroundings are averaged."""
MARGIN = 3
"""Pixels about an object's convex hull: its rim is the least sure."""

Image = Float32[np.ndarray, "height width 3"]
Outline = Int32[np.ndarray, "_ 1 2"]


def outline_of(region: Region, weight: Float32[np.ndarray, "height width"]) -> Outline | None:
    """Convex hull of a region's changed pixels: what lies between the moving rims of an object is the object.

    None where nothing changed.
    """
    corners = cv2.findNonZero(((weight[region.window] > 0.5) & region.inside).astype(np.uint8))
    return None if corners is None else cv2.convexHull(corners + np.array(region.corner, np.int32))


def without_lingering(
    known: Background,
    images: Sequence[Image],
    outlines: Sequence[Sequence[Outline]],
) -> Background:
    """A camera's background, learnt anew where objects cover it often.

    Args:
        known: learnt from these images.
        images: of some frames, as `as_background` gives them.
        outlines: of the objects in each of them.
    """
    covered = np.stack([_drawn(each, known.variance.shape) for each in outlines])
    often = covered.sum(axis=0) > OFTEN * len(images)
    if not often.any():
        return known
    hidden = covered[:, often]
    values = np.stack([image[often] for image in images])
    shown = np.where(hidden[..., None], np.float32(np.nan), values)
    seen = (~hidden).sum(axis=0) >= FEWEST
    mean, variance = known.mean.copy(), known.variance.copy()
    middle, deviation = np.zeros((len(seen), 3), np.float32), np.full(len(seen), GUESSED, np.float32)
    if seen.any():
        middle[seen] = np.nanmedian(shown[:, seen], axis=0)
        apart = np.abs(shown[:, seen] - middle[seen])
        deviation[seen] = 1.4826 * np.nanmedian(apart, axis=0).max(axis=-1)
    # Where the frames without the object say the same as before, what was learnt from all of them is better.
    wrong = seen & (np.abs(middle - mean[often]).max(axis=-1) > np.maximum(WRONG, 3 * deviation))
    mean[often] = np.where(wrong[:, None], middle, mean[often])
    variance[often] = np.where(wrong, np.clip(deviation, GUESSED, GREATEST_DEVIATION) ** 2, variance[often])
    unseen = np.zeros(often.shape, np.uint8)
    unseen[often] = ~seen
    _continue(mean, variance, unseen)
    return replace(known, mean=mean, variance=variance, grey=coarse(mean))


def _drawn(outlines: Sequence[Outline], shape: tuple[int, ...]) -> Bool[np.ndarray, "height width"]:
    mask = np.zeros(shape, np.uint8)
    for one in outlines:
        if cv2.contourArea(one) <= LARGEST * mask.size:
            cv2.fillConvexPoly(mask, one, 1)
    return cv2.dilate(mask, np.ones((2 * MARGIN + 1, 2 * MARGIN + 1), np.uint8)) > 0


def _continue(
    mean: Float32[np.ndarray, "height width 3"],
    variance: Float32[np.ndarray, "height width"],
    unseen: UInt8[np.ndarray, "height width"],
) -> None:
    """Put the surroundings' colours where nothing was seen, in place, if the surroundings are plain.

    Normalised convolution as wide as the gap (Knutsson & Westin 1993). Where they have a texture, the median of all
    frames is as good a guess as theirs.
    """
    count, labels, stats, _ = cv2.connectedComponentsWithStats(unseen, connectivity=8)
    for x, y, columns, rows, _ in stats[1:count]:
        reach = int(max(columns, rows))
        window = np.s_[max(y - reach, 0) : y + rows + reach, max(x - reach, 0) : x + columns + reach]
        gap = labels[window] > 0
        if not gap.all() and np.std(mean[window][_rim(gap)], axis=0).max() < PLAIN:
            mean[window][gap] = _surroundings(mean[window], gap, reach)[gap]
            variance[window][gap] = GUESSED**2


def _rim(gap: Bool[np.ndarray, "rows columns"]) -> Bool[np.ndarray, "rows columns"]:
    """Pixels around a gap, at a distance at which nothing of the object is left."""
    gap_now = gap.astype(np.uint8)
    near, far = (cv2.dilate(gap_now, np.ones((size, size), np.uint8)) for size in (2 * MARGIN + 1, 6 * MARGIN + 1))
    rim = (far > 0) & (near == 0)
    return rim if rim.any() else ~gap


def _surroundings(
    mean: Float32[np.ndarray, "rows columns 3"], gap: Bool[np.ndarray, "rows columns"], reach: int
) -> Float32[np.ndarray, "rows columns 3"]:
    """Averages of the known pixels about each one, at the size at which the gap is some tens of pixels."""
    known, scale = (~gap).astype(np.float32), max(1.0, reach / GAP_PX)
    size = max(1, round(gap.shape[1] / scale)), max(1, round(gap.shape[0] / scale))
    small = (cv2.resize(one, size, interpolation=cv2.INTER_AREA) for one in (mean * known[..., None], known))
    blurred = (cv2.GaussianBlur(one, (0, 0), 0.3 * reach / scale) for one in small)
    colours, weight = (cv2.resize(one, gap.shape[::-1]) for one in blurred)
    return colours / np.maximum(weight, np.float32(1e-6))[..., None]
