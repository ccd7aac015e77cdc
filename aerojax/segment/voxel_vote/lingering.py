"""Backgrounds behind objects that stay: where one covers a pixel in most frames, their median is the object.

Its rim moves nevertheless, and the cameras agree on it. What it covers in a frame says nothing of the background then;
the median is taken of the other frames, and where there are none the surroundings are continued.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import cv2
import numpy as np
from jaxtyping import Bool, Int32, UInt8

from aerojax.segment.voxel_vote.background import Background
from aerojax.segment.voxel_vote.cluster import Region
from aerojax.segment.voxel_vote.continued import continue_surroundings
from aerojax.segment.voxel_vote.registration import coarse

OFTEN = 0.34
"""Share of the frames in which an object covers a pixel, from which on the median is not to be trusted."""
FEWEST = 2
"""Frames without an object whose median is a background."""
SURE = 0.01
"""Standard deviation of the median of few frames, sRGB, at least."""
WRONG = 0.015
"""Difference of a background, sRGB, from the frames without an object, from which on it shows the object."""
LARGEST = 0.1
"""Of an image; what covers more is no object that flies, and nothing is learnt from it."""
MARGIN = 3
"""Pixels about an object's convex hull: its rim is the least sure."""
STEADY = 0.03
"""From its least value to its greatest, sRGB: a pixel that changes less is the same in all frames."""
UNSTEADY = 2.0
"""Deviations from its least value to its greatest, by which a pixel changes more than it does without an object."""
CLOSED_PX = 5
"""Pixels of a gap in what changes, through which the inside of an object is not taken for its outside."""

Bytes = UInt8[np.ndarray, "height width 3"]
Outline = Int32[np.ndarray, "_ 1 2"]


def outline_of(region: Region) -> Outline | None:
    """Convex hull of a region: what lies between the moving rims of an object is the object."""
    corners = cv2.findNonZero(region.inside.astype(np.uint8))
    return None if corners is None else cv2.convexHull(corners + np.array(region.corner, np.int32))


def without_lingering(
    known: Background, images: Sequence[Bytes], outlines: Mapping[int, Sequence[Outline]]
) -> Background:
    """A camera's background, learnt anew where objects cover it often.

    Args:
        known: learnt from these images.
        images: of some frames, in the background's place and light.
        outlines: of the objects in those of them that were looked at, by their place in `images`.
    """
    covered = _covered(outlines, known.variance.shape, len(images))
    often = _restless(covered.sum(axis=0) > OFTEN * len(images), images, known)
    if not often.any():
        return known
    hidden = covered[:, often]
    values = np.stack([image[often] for image in images]).astype(np.float32) / 255
    shown = np.where(hidden[..., None], np.float32(np.nan), values)
    seen = (~hidden).sum(axis=0) >= FEWEST
    mean, variance = known.mean.copy(), known.variance.copy()
    middle, spread = np.zeros((len(seen), 3), np.float32), np.zeros(len(seen), np.float32)
    if seen.any():
        middle[seen] = np.nanmedian(shown[:, seen], axis=0)
        spread[seen] = 1.4826 * np.nanmedian(np.abs(shown[:, seen] - middle[seen]), axis=0).max(axis=-1)
    # Where the frames without the object say the same as before, what was learnt from all of them is better.
    wrong = seen & (np.abs(middle - mean[often]).max(axis=-1) > WRONG)
    mean[often] = np.where(wrong[:, None], middle, mean[often])
    varies = np.maximum(spread, np.float32(SURE)) ** 2
    variance[often] = np.where(wrong, np.minimum(varies, variance[often]), variance[often])
    unseen = np.zeros(often.shape, np.uint8)
    unseen[often] = ~seen
    continue_surroundings(mean, variance, unseen)
    return replace(known, mean=mean, variance=variance, grey=coarse(mean))


def _covered(
    outlines: Mapping[int, Sequence[Outline]], shape: tuple[int, ...], count: int
) -> Bool[np.ndarray, "time height width"]:
    """What objects cover in each frame.

    In a frame that was not looked at, and in one in which none was found, what they cover in the frames with one before
    and after it: where the background shows an object in its place, nothing differs, and it is there all the same.
    """
    drawn = {frame: _drawn(each, shape) for frame, each in sorted(outlines.items()) if each}
    covered = np.zeros((count, *shape), bool)
    for frame in range(count):
        before, after = [f for f in drawn if f <= frame], [f for f in drawn if f >= frame]
        for nearest in {*before[-1:], *after[:1]}:
            covered[frame] |= drawn[nearest]
    return covered


def _drawn(outlines: Sequence[Outline], shape: tuple[int, ...]) -> Bool[np.ndarray, "height width"]:
    mask = np.zeros(shape, np.uint8)
    for one in outlines:
        if cv2.contourArea(one) <= LARGEST * mask.size:
            cv2.fillConvexPoly(mask, one, 1)
    return cv2.dilate(mask, np.ones((2 * MARGIN + 1, 2 * MARGIN + 1), np.uint8)) > 0


def _restless(
    often: Bool[np.ndarray, "height width"], images: Sequence[Bytes], known: Background
) -> Bool[np.ndarray, "height width"]:
    """Of these pixels those that change from frame to frame, and what they enclose.

    A steady pixel is background, and its median is right, unless what changes surrounds it: it is then the inside of an
    object, whose rim alone moves.
    """
    result, deviation = np.zeros_like(often), np.sqrt(known.variance)
    count, _, stats, _ = cv2.connectedComponentsWithStats(often.astype(np.uint8), connectivity=8)
    for x, y, columns, rows, _ in stats[1:count]:
        window = np.s_[max(y - 1, 0) : y + rows + 1, max(x - 1, 0) : x + columns + 1]
        values = np.stack([cv2.GaussianBlur(image[window], (3, 3), 0.8) for image in images])
        change = np.ptp(values, axis=0).max(axis=-1).astype(np.float32) / 255
        usual = np.maximum(deviation[window], np.median(deviation[window]))
        moves = (often[window] & (change > np.maximum(STEADY, UNSTEADY * usual))).astype(np.uint8)
        result[window] |= _enclosed(moves) & often[window]
    return result


def _enclosed(moves: UInt8[np.ndarray, "rows columns"]) -> Bool[np.ndarray, "rows columns"]:
    """Pixels, the ones next to them, and all that these surround."""
    square = np.ones((CLOSED_PX, CLOSED_PX), np.uint8)
    wide = np.pad(cv2.dilate(moves, np.ones((3, 3), np.uint8)), CLOSED_PX)
    outside = cv2.morphologyEx(wide, cv2.MORPH_CLOSE, square)
    cv2.floodFill(outside, None, (0, 0), 2)
    return (outside != 2)[CLOSED_PX:-CLOSED_PX, CLOSED_PX:-CLOSED_PX]
