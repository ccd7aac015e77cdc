"""Masks and boxes of a clip in the images as they are stored, lens and all."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float32

from aerojax.capture.format import Capture, CaptureCamera
from aerojax.capture.lenses import undistort_points
from aerojax.core.types import Box
from aerojax.geometry.boxes import tight_box
from aerojax.pipeline.offline import Clip

_GRID = 8
"""Pixels between the points at which a lens is evaluated; between them it is as good as linear."""


@dataclass(frozen=True, eq=False)
class Sighting:
    """The object in one image of one camera.

    frame: number in the capture. camera: index in the network.
    mask: pixels that it covers. box: of the mask.
    """

    frame: int
    camera: int
    mask: Bool[np.ndarray, "height width"]
    box: Box


def sightings(capture: Capture, clip: Clip, *, stored: bool = True) -> Iterator[Sighting]:
    """Every image that the object was seen in and that counted, in order of frame and camera.

    Args:
        capture: what was classified.
        clip: of it, with its observations.
        stored: whether pixels are those of the files; else those of the undistorted images.
    """
    for observation in clip.observations:
        covered = np.asarray(observation.views.mask, np.float32)
        for index, camera in enumerate(capture.cameras):
            if not observation.valid[index]:
                continue
            homography = observation.crop_from_image[index]
            mask = _in_image(covered[index], homography, camera)
            if stored and camera.distortion_model != "none":
                columns, rows = _stored_maps(_Lens(camera))
                mask = cv2.remap(mask, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=0)
            inside = mask > 0.5
            box = tight_box(inside)
            if box is not None:
                yield Sighting(observation.frame, index, inside, box)


def _in_image(
    covered: Float32[np.ndarray, "side side"], crop_from_image: np.ndarray, camera: CaptureCamera
) -> Float32[np.ndarray, "height width"]:
    """A crop's coverage in the undistorted image: each pixel looks up where its centre lies in the crop."""
    to_corner, to_centre = np.eye(3), np.eye(3)  # OpenCV puts the centre of the top-left pixel at (0, 0)
    to_corner[:2, 2], to_centre[:2, 2] = 0.5, -0.5
    lookup = to_centre @ crop_from_image @ to_corner
    size = camera.width, camera.height
    return cv2.warpPerspective(covered, lookup, size, flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)


class _Lens:
    """A camera that is known again by its lens."""

    def __init__(self, camera: CaptureCamera) -> None:
        self.camera = camera
        self.key = camera.K.tobytes(), camera.distortion_model, camera.distortion, camera.width, camera.height

    def __hash__(self) -> int:
        return hash(self.key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Lens) and self.key == other.key


@functools.lru_cache(maxsize=16)
def _stored_maps(lens: _Lens) -> tuple[Float32[np.ndarray, "height width"], Float32[np.ndarray, "height width"]]:
    """Where each pixel of the stored image lies in the undistorted one, for `cv2.remap`."""
    camera = lens.camera
    columns = np.arange(0, camera.width + _GRID, _GRID, dtype=np.float64)
    rows = np.arange(0, camera.height + _GRID, _GRID, dtype=np.float64)
    u, v = np.meshgrid(columns, rows)
    pixels = np.stack([u.ravel(), v.ravel()], axis=1) + 0.5
    straight = undistort_points(pixels, camera.K, camera.distortion_model, camera.distortion) - 0.5
    coarse = straight.reshape(len(rows), len(columns), 2).astype(np.float32)
    # Between the grid's points: pixel x lies at x / _GRID of the coarse map.
    fine_u, fine_v = np.meshgrid(
        np.arange(camera.width, dtype=np.float32) / _GRID, np.arange(camera.height, dtype=np.float32) / _GRID
    )
    fine = cv2.remap(coarse, fine_u, fine_v, cv2.INTER_LINEAR)
    return np.ascontiguousarray(fine[..., 0]), np.ascontiguousarray(fine[..., 1])
