"""From an object's voxels back to one soft mask a camera (thesis C.4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float32, UInt8

from aerojax.segment.voxel_vote.background import Difference
from aerojax.segment.voxel_vote.cluster import Region


@dataclass(frozen=True)
class MaskConfig:
    """How pixels about an object's voxels are shared between it and its background.

    margin_px: by which the voxels' projection is widened.
    deviations, least: of a difference that may be the object's, in deviations of its pixel and sRGB: near an object
        less evidence is needed than to find one.
    half: share of a pixel's neighbour by which it differs if the object covers it by half; below one half, because thin
        parts fill no pixel and their silhouettes are wanted whole.
    hole: largest part of the object, beside `FEWEST_HOLE_PX`, that a gap inside it may be and still be filled.
    """

    margin_px: int = 3
    deviations: float = 2.5
    least: float = 0.012
    half: float = 0.3
    hole: float = 0.03


FEWEST_HOLE_PX = 4
"""A gap of so many pixels is filled in any object."""


def coverage_of(
    region: Region, seen: Difference, weight: Float32[np.ndarray, "height width"], config: MaskConfig
) -> Float32[np.ndarray, "height width"]:
    """Share of each pixel that the object covers: 0 outside of its voxels' projection and where nothing differs.

    A pixel of which the object covers the share a differs by a (object - background), so that its difference over the
    largest one next to it is that share: I = aF + (1 - a)B (Porter & Duff 1984).

    Args:
        region: the voxels' projection.
        weight: of the motion cue; parts without any of it are noise.
    """
    coverage = np.zeros_like(weight)
    wide = widened(region, weight.shape, config.margin_px)
    (rows, columns), inside = wide.window, wide.inside
    size, deviation = seen.size[rows, columns], seen.deviation[rows, columns]
    differs = ((size > np.maximum(config.deviations * deviation, config.least)) & inside).astype(np.uint8)
    differs = _with_motion(differs, weight[rows, columns])
    square = np.ones((3, 3), np.uint8)
    share = size / np.maximum(cv2.dilate(size * differs, square), np.float32(1e-6))
    filled = _filled(differs, config)
    inner = cv2.erode(filled, square, borderValue=0) | (filled - differs)
    coverage[rows, columns] = np.where(
        inner > 0, np.float32(1), np.minimum(share * np.float32(0.5 / config.half), 1) * differs
    )
    return coverage


def widened(region: Region, shape: tuple[int, int], margin: int) -> Region:
    """A region with the pixels that are at most `margin` rows and columns away, in an image of this shape."""
    (x, y), (rows, columns) = region.corner, region.inside.shape
    x0, y0 = max(x - margin, 0), max(y - margin, 0)
    x1, y1 = min(x + columns + margin, shape[1]), min(y + rows + margin, shape[0])
    inside = np.zeros((y1 - y0, x1 - x0), np.uint8)
    inside[y - y0 : y - y0 + rows, x - x0 : x - x0 + columns] = region.inside
    square = np.ones((2 * margin + 1, 2 * margin + 1), np.uint8)
    return Region((x0, y0), cv2.dilate(inside, square) > 0)


def without(region: Region, others: Sequence[Region]) -> Region:
    """A region without the pixels of others."""
    inside, (x, y) = region.inside.copy(), region.corner
    rows, columns = inside.shape
    for other in others:
        left, top = other.corner[0] - x, other.corner[1] - y
        height, width = other.inside.shape
        here = np.s_[max(top, 0) : max(min(top + height, rows), 0), max(left, 0) : max(min(left + width, columns), 0)]
        there = np.s_[max(-top, 0) : max(rows - top, 0), max(-left, 0) : max(columns - left, 0)]
        inside[here] &= ~other.inside[there]
    return Region(region.corner, inside)


def _with_motion(
    differs: UInt8[np.ndarray, "rows columns"], weight: Float32[np.ndarray, "rows columns"]
) -> UInt8[np.ndarray, "rows columns"]:
    """The connected parts that hold weight."""
    count, labels = cv2.connectedComponents(differs, connectivity=8)
    moves = np.bincount(labels.ravel(), weights=weight.ravel(), minlength=count) >= 1
    moves[0] = False
    return moves[labels].astype(np.uint8)


def _filled(differs: UInt8[np.ndarray, "rows columns"], config: MaskConfig) -> UInt8[np.ndarray, "rows columns"]:
    """With its small holes; a hole does not reach the window's border."""
    most = max(FEWEST_HOLE_PX, config.hole * np.count_nonzero(differs))
    _, labels, stats, _ = cv2.connectedComponentsWithStats(1 - differs, connectivity=4)
    outer = np.unique(np.concatenate([labels[0], labels[-1], labels[:, 0], labels[:, -1]]))
    small = stats[:, cv2.CC_STAT_AREA] <= most
    small[0], small[outer] = False, False
    return (small[labels] | (differs > 0)).astype(np.uint8)
