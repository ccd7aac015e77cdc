"""Detections of a capture's instance masks: each instance's box, in every image."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from jaxtyping import Integer

from aerojax.capture.format import Capture
from aerojax.capture.frames import read_frames
from aerojax.capture.lenses import distort_points
from aerojax.core.errors import UserError
from aerojax.core.types import Box
from aerojax.geometry.boxes import tight_box, touches_border
from aerojax.track.sights import Detections

FEWEST_PIXELS = 4
"""An instance of fewer is noise."""


def mask_detections(
    capture: Capture, *, progress: Callable[[int, int, str], None] = lambda done, total, what: None
) -> Detections:
    """The middle of every instance that a camera shows whole, image by image, stamped by the camera's own clock.

    Which instance it is is left out: it is for the tracker to find.

    Args:
        capture: with masks of instances.
        progress: called for each frame with (done, total, what).

    Raises:
        UserError: no mask shows anything.
    """
    own_clocks = replace(capture, cameras=tuple(replace(camera, time_offset_s=0.0) for camera in capture.cameras))
    rows: list[tuple[int, float, float, float, float]] = []
    for frame in range(capture.frames):
        seen = read_frames(own_clocks, frame, rgb=False)
        for camera, mask in enumerate(seen.ids):
            for _, (x0, y0, x1, y1) in () if mask is None else whole_instances(mask):
                diagonal = float(np.hypot(x1 - x0, y1 - y0))
                rows.append((camera, seen.time_s, (x0 + x1) / 2, (y0 + y1) / 2, diagonal))
        progress(frame + 1, capture.frames, "masks")
    if not rows:
        raise UserError("object-absent", f"{capture.folder}: no mask shows a whole object", "give detections instead")
    table = np.array(rows, np.float64)
    return _stored(capture, Detections(table[:, 0].astype(np.int64), table[:, 1], table[:, 2:4], table[:, 4]))


def _stored(capture: Capture, straight: Detections) -> Detections:
    """Of pixels of undistorted images, as all masks are on reading, those of the stored ones."""
    pixels = straight.pixels.copy()
    for index, camera in enumerate(capture.cameras):
        own = straight.camera == index
        pixels[own] = distort_points(pixels[own], camera.K, camera.distortion_model, camera.distortion)
    return replace(straight, pixels=pixels)


def whole_instances(mask: Integer[np.ndarray, "height width"]) -> Iterator[tuple[int, Box]]:
    """Numbers and boxes of the instances that a mask shows whole."""
    height, width = mask.shape
    for number in np.unique(mask[mask > 0]).tolist():
        box = tight_box(mask == number, min_pixels=FEWEST_PIXELS)
        if box is not None and not touches_border(box, width, height):
            yield number, box
