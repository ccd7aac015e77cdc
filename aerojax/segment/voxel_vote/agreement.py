"""Which of an object's masks the others contradict: what moves before trees may be leaves.

Where three cameras or more see an object before the sky, its outline in another camera is known but for the depth: a
pixel can be the object's only if a point of its ray lies in all their masks (image-based visual hulls, Matusik et al.
2000).
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from jaxtyping import Bool, Float64

from aerojax.capture.format import CaptureCamera
from aerojax.core.types import Silhouette
from aerojax.geometry.cameras import pixel_rays, project_points
from aerojax.segment.voxel_vote.cluster import Candidate
from aerojax.segment.voxel_vote.volume import FEWEST_VIEWS

ALONG = 64
"""Points of a ray that are looked at, over the object's voxels."""
ACROSS = 24
"""Pixels along the longer side of the part of the image that are looked at."""
INSIDE = 0.7
"""Share of a mask that its hull must hold; it holds all of an object's silhouette, but is wider: three views of a thin
object leave room for ten of it."""
FILLED = 0.15
"""Share of the hull that a mask must fill; a few leaves lie inside of it by chance."""

Mask = Bool[np.ndarray, "height width"]


def uncontradicted(
    one: Candidate,
    masks: Sequence[Silhouette],
    before_sky: Sequence[bool],
    cameras: Sequence[CaptureCamera],
) -> list[Silhouette]:
    """The masks that were seen before the sky, and of the others those that their hull agrees with.

    Args:
        one: the object.
        masks: its silhouettes, at most one a camera.
        before_sky: which of them lie before the sky; all are kept where those are fewer than three.
        cameras: of the network.
    """
    sure = [mask for mask, clear in zip(masks, before_sky, strict=True) if clear]
    if not FEWEST_VIEWS <= len(sure) < len(masks):
        return list(masks)
    square = np.ones((3, 3), np.uint8)
    cones = [(cameras[own.camera], cv2.dilate((own.coverage > 0).astype(np.uint8), square) > 0) for own in sure]
    return [
        mask
        for mask, clear in zip(masks, before_sky, strict=True)
        if clear or _agrees(one, mask, cameras[mask.camera], cones)
    ]


def _agrees(
    one: Candidate, mask: Silhouette, camera: CaptureCamera, cones: Sequence[tuple[CaptureCamera, Mask]]
) -> bool:
    region = one.regions[mask.camera]
    if region is None:
        return False
    pixels = _lattice(region.window)
    may_be, shown = _in_hull(one, pixels, camera, cones), _at(mask.coverage > 0.5, pixels)
    both = np.count_nonzero(may_be & shown)
    return bool(both >= max(INSIDE * np.count_nonzero(shown), FILLED * np.count_nonzero(may_be)))


def _lattice(window: tuple[slice, slice]) -> Float64[np.ndarray, "pixel 2"]:
    """Centres of pixels all over a window, at most `ACROSS` along its longer side."""
    step = max(1, -(-max(part.stop - part.start for part in window) // ACROSS))
    rows, columns = (np.arange(part.start, part.stop, step) for part in window)
    return np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2) + 0.5


def _in_hull(
    one: Candidate,
    pixels: Float64[np.ndarray, "pixel 2"],
    camera: CaptureCamera,
    cones: Sequence[tuple[CaptureCamera, Mask]],
) -> Bool[np.ndarray, "pixel"]:
    """Pixels on whose rays a point lies in all cones: in each camera's mask, or next to it."""
    place = camera.world_from_cam[:3, 3]
    away = np.linalg.norm(one.centre - place) + one.size * np.linspace(-1, 1, ALONG)
    points = place + away[:, None, None] * pixel_rays(pixels, camera)
    inside = np.ones(points.shape[:2], bool)
    for other, mask in cones:
        inside &= _at(mask, project_points(points, other, behind=-1.0))
    return np.any(inside, axis=0)


def _at(mask: Mask, pixels: Float64[np.ndarray, "*batch 2"]) -> Bool[np.ndarray, "*batch"]:
    """What a mask says of these pixels, nothing outside of the image."""
    column, row = (np.floor(axis).astype(int) for axis in np.moveaxis(pixels, -1, 0))
    inside = (row >= 0) & (row < mask.shape[0]) & (column >= 0) & (column < mask.shape[1])
    return inside & mask[np.where(inside, row, 0), np.where(inside, column, 0)]
