"""What fixed and random rigs share: cameras that look at a point, the monitored volume, who sees what."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float, Int

from aerojax.capture.format import CaptureCamera
from aerojax.geometry.cameras import look_at, pixels_of_camera_points, points_in_camera

RigKind = Literal["sphere", "circle", "line"]

BODY_RADIUS = 0.6
"""Metres around its origin that an object of 1 m fills, with the swing of wings."""


@dataclass(frozen=True)
class Volume:
    """The monitored box.

    low, high: lowest and highest corner, metres, world.
    """

    low: tuple[float, float, float] = (0.0, 0.0, 0.0)
    high: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def contains(self, points: Float[np.ndarray, "point 3"]) -> bool:
        """Whether all points lie inside or on the border."""
        return bool(np.all((points >= self.low) & (points <= self.high)))


def aimed_camera(
    index: int, centre: Float[np.ndarray, "3"], target: Float[np.ndarray, "3"], *, focal: float, size: tuple[int, int]
) -> CaptureCamera:
    """Camera number `index` of a network, looking at `target` (metres, world), with a pattern for colour alone.

    Args:
        index: from 0; names the camera and its folder.
        centre: of the camera, metres, world.
        target: what the middle of the image shows.
        focal: pixels, the same along both axes.
        size: width and height of the image, pixels.
    """
    name, (width, height) = f"cam_{index + 1:02d}", size
    return CaptureCamera(
        name=name,
        width=width,
        height=height,
        K=np.array([[focal, 0.0, width / 2], [0.0, focal, height / 2], [0.0, 0.0, 1.0]]),
        distortion_model="none",
        distortion=(),
        world_from_cam=look_at(centre, target),
        rgb=f"{name}/rgb/{{frame:06d}}.png",
        mask=None,
        depth=None,
        time_offset_s=0.0,
    )


def cameras_that_see(
    points: Float[np.ndarray, "point 3"], cameras: tuple[CaptureCamera, ...], radius: float = BODY_RADIUS
) -> Int[np.ndarray, "point"]:
    """How many cameras have a ball of `radius` metres around each point wholly in their image (obstacles aside)."""
    seen = np.zeros(len(points), int)
    for camera in cameras:
        inside = points_in_camera(points, camera)
        ahead = inside[:, 2] > radius
        inside[:, 2] = np.maximum(inside[:, 2], 1e-9)
        pixels, margin = pixels_of_camera_points(inside, camera), camera.K[0, 0] * radius / inside[:, 2:]
        within = np.all((pixels - margin >= 0) & (pixels + margin <= (camera.width, camera.height)), axis=1)
        seen += within & ahead
    return seen
