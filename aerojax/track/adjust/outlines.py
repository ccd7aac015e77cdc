"""Outlines of what masks show: the convex hull of every instance that a camera shows whole and uncovered."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
from jaxtyping import Float64, Integer

from aerojax.capture.format import Capture
from aerojax.capture.frames import read_frames
from aerojax.core.types import Box
from aerojax.track.masks import whole_instances

Outlines = tuple[Float64[np.ndarray, "_ 2"], ...]
"""Corners of each detection's hull, pixels of the undistorted image; none where it may be partly covered."""
_NEAR = 2
"""Pixels from another instance at which one may be covered by it."""


def mask_outlines(
    capture: Capture, *, progress: Callable[[int, int, str], None] = lambda done, total, what: None
) -> Outlines:
    """The hulls of what `mask_detections` finds, in its order.

    Args:
        capture: with masks of instances.
        progress: called for each frame with (done, total, what).
    """
    own_clocks = replace(capture, cameras=tuple(replace(camera, time_offset_s=0.0) for camera in capture.cameras))
    found = []
    for frame in range(capture.frames):
        for mask in read_frames(own_clocks, frame, rgb=False).ids:
            if mask is not None:
                found += [_outline(mask, number, box) for number, box in whole_instances(mask)]
        progress(frame + 1, capture.frames, "outlines")
    return tuple(found)


def _outline(mask: Integer[np.ndarray, "height width"], number: int, box: Box) -> Float64[np.ndarray, "corner 2"]:
    x0, y0, x1, y1 = (int(side) for side in box)
    left, top = max(x0 - _NEAR, 0), max(y0 - _NEAR, 0)
    part = mask[top : y1 + _NEAR, left : x1 + _NEAR]
    own = (part == number).astype(np.uint8)
    near = cv2.dilate(own, np.ones((2 * _NEAR + 1, 2 * _NEAR + 1), np.uint8)) > 0
    if np.any(near & (part > 0) & (own == 0)):
        return np.zeros((0, 2))
    rows, columns = np.nonzero(own)
    hull = cv2.convexHull(np.stack([columns, rows], axis=1).astype(np.int32))[:, 0]
    return hull + np.array([left + 0.5, top + 0.5])
