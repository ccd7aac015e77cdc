"""The monitored volume: where enough cameras of a network look."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64

from aerojax.capture.format import CaptureCamera
from aerojax.geometry.cameras import pixel_rays, pixels_of_camera_points, points_in_camera

FEWEST_VIEWS = 3
"""Cameras that must look at a place where there are as many: any two rays nearly meet somewhere."""
NEAREST = 1e-3
"""Of the furthest depth; nearer than that a camera sees lenses and raindrops."""
DEPTHS, PIXELS = 96, 9
"""Along every ray and along every side of the image, where frusta are probed."""
LEAST_TURN = 0.035
"""Between the rows of images, radians, root mean square, from which on they span a level plane."""
COARSE = 16
"""Cells along a side of the root cube from which each frame's search starts: 4³ levels of nothing are skipped."""


@dataclass(frozen=True, eq=False)
class Seen:
    """Where places lie in one camera's image.

    pixels: of their centres. per_metre: pixels that a metre spans there, 0 behind the camera.
    """

    pixels: Float64[np.ndarray, "place 2"]
    per_metre: Float64[np.ndarray, "place"]

    def near_image(self, camera: CaptureCamera, radius: Float64[np.ndarray, "place"]) -> Bool[np.ndarray, "place"]:
        """Places of which a ball of so many pixels touches the image; negative radii ask that it lies inside."""
        u, v = self.pixels.T
        inside = (u + radius > 0) & (u - radius < camera.width) & (v + radius > 0) & (v - radius < camera.height)
        return inside & (self.per_metre > 0)


@dataclass(frozen=True, eq=False)
class Volume:
    """Cubes that enough cameras see, of one size; a search divides them.

    centres: metres, in the frame of the cameras. half: half their side, metres.
    """

    cameras: tuple[CaptureCamera, ...]
    centres: Float64[np.ndarray, "cube 3"]
    half: float

    def is_below(self, place: Float64[np.ndarray, "3"]) -> bool:
        """Whether a place lies lower than all cameras do; none does where nothing says which way down is."""
        poses = np.stack([camera.world_from_cam for camera in self.cameras])
        down = _down(poses)
        return down is not None and bool(place @ down > (poses[:, :3, 3] @ down).max())


def _down(poses: Float64[np.ndarray, "camera 4 4"]) -> Float64[np.ndarray, "3"] | None:
    """What the rows of all images are level with, so that cameras may look up or down; None where rows are parallel."""
    rows = poses[:, :3, 0]
    spread, axes = np.linalg.eigh(rows.T @ rows / len(rows))
    if spread[1] < LEAST_TURN**2:
        return None
    return axes[:, 0] * np.sign(axes[:, 0] @ poses[:, :3, 1].sum(axis=0))


def seen_by(camera: CaptureCamera, centres: Float64[np.ndarray, "place 3"], nearest: float = 0.0) -> Seen:
    """Where a camera sees these places (metres, frame of the cameras)."""
    inside = points_in_camera(centres, camera)
    depth = inside[:, 2]
    focal = max(camera.K[0, 0], camera.K[1, 1])
    per_metre = np.where(depth > nearest, focal / np.maximum(depth, 1e-9), 0.0)
    return Seen(pixels_of_camera_points(inside, camera), per_metre)


def monitored_volume(cameras: Sequence[CaptureCamera], *, reach: float) -> Volume:
    """Where at least three cameras look (all, where there are fewer), as coarse cubes around it.

    Frusta are probed along their rays at logarithmic depths up to `reach`: beyond some widths of the network a pixel of
    disparity is more than an object's size.

    Args:
        cameras: at least two at different places.
        reach: furthest distance from a camera, in distances between the two cameras furthest apart.
    """
    places = np.stack([camera.world_from_cam[:3, 3] for camera in cameras])
    base = max(float(np.linalg.norm(a - b)) for a, b in itertools.combinations(places, 2)) if len(cameras) > 1 else 1.0
    probes = np.concatenate([_probes(camera, reach * max(base, 1e-3)) for camera in cameras])
    needed = min(FEWEST_VIEWS, len(cameras))
    kept = probes[_views(cameras, probes, np.zeros(len(probes))) >= needed]
    if not len(kept):
        return Volume(tuple(cameras), np.zeros((0, 3)), 0.0)
    low, high = kept.min(axis=0), kept.max(axis=0)
    half = float((high - low).max()) / (2 * COARSE) * 1.0001
    steps = [np.arange(np.ceil((high[i] - low[i]) / (2 * half))) for i in range(3)]
    cells = np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 3)
    centres = low + half * (2 * cells + 1)
    return Volume(tuple(cameras), centres[_views(cameras, centres, np.full(len(centres), half)) >= needed], half)


def _probes(camera: CaptureCamera, furthest: float) -> Float64[np.ndarray, "place 3"]:
    across = [np.linspace(0, side, PIXELS) for side in (camera.width, camera.height)]
    pixels = np.stack(np.meshgrid(*across), axis=-1).reshape(-1, 2)
    depths = np.geomspace(NEAREST * furthest, furthest, DEPTHS)
    rays = pixel_rays(pixels, camera)
    return (camera.world_from_cam[:3, 3] + depths[:, None, None] * rays).reshape(-1, 3)


def _views(
    cameras: Sequence[CaptureCamera], centres: Float64[np.ndarray, "place 3"], half: Float64[np.ndarray, "place"]
) -> np.ndarray:
    """How many cameras see each place, or a part of the cube around it."""
    total = np.zeros(len(centres), int)
    for camera in cameras:
        seen = seen_by(camera, centres)
        total += seen.near_image(camera, np.sqrt(3) * half * seen.per_metre)
    return total
