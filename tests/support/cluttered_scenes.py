"""Ellipsoids that fly before textured backgrounds, with the shadows that they throw, seen by a network of cameras."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from aerojax.capture.format import CaptureCamera
from aerojax.core.seeds import seed_of
from aerojax.core.types import FrameSet
from aerojax.evaluate.clutter import Clutter, ClutterConfig
from aerojax.geometry.cameras import look_at, project_points

CALM = ClutterConfig(clouds=0.0, leaves=0, shadows=0, drift=0.0, noise=0.004, sway_px=0.0)
GROUND = -3.0
"""Height of the plane on which objects throw shadows, metres."""
_SUN = np.array([0.4, 0.3, -1.0])


@dataclass(frozen=True)
class Flyer:
    """An ellipsoid: half axes in metres, sRGB, and its centre by the frame's number."""

    axes: tuple[float, float, float]
    colour: tuple[float, float, float]
    path: Callable[[int], np.ndarray]


@dataclass(frozen=True)
class Scene:
    """Cameras on a circle of 12 m, objects, clutter, cameras that see waving trees alone, and what it is drawn from."""

    flyers: tuple[Flyer, ...]
    cameras: int = 4
    size: tuple[int, int] = (320, 240)
    focal: float = 300.0
    clutter: ClutterConfig = CALM
    trees: tuple[int, ...] = ()
    mottling: float = 0.18
    ground: tuple[float, float, float] = (0.35, 0.42, 0.22)
    seed: int = 0

    def network(self) -> tuple[CaptureCamera, ...]:
        found = []
        for index in range(self.cameras):
            angle = 2 * np.pi * index / self.cameras + 0.2 + 0.1 * np.sin(index)
            centre = np.array([12 * np.cos(angle), 12 * np.sin(angle), -1.5 + 0.3 * (index % 3)])
            K = np.array([[self.focal, 0, self.size[0] / 2], [0, self.focal, self.size[1] / 2], [0, 0, 1.0]])
            name = f"cam_{index + 1:02d}"
            pose = np.asarray(look_at(centre, np.array([0.0, 0.0, 0.5])), np.float64)
            found.append(CaptureCamera(name, *self.size, K, "none", (), pose, f"{name}/{{frame}}.png", None, None, 0.0))
        return tuple(found)

    def frame_sets(self, frames: Sequence[int]) -> Iterator[tuple[FrameSet, list[np.ndarray]]]:
        """Frame sets without masks, and the true ids of every camera's pixels (flyer 0 is 1)."""
        cameras = self.network()
        rays = [_rays(camera) for camera in cameras]
        stills = [
            _background(camera, ray, self.ground, self.mottling, seed_of(self.seed, i))
            for i, (camera, ray) in enumerate(zip(cameras, rays, strict=True))
        ]
        clutter = [
            Clutter(*self.size, seed=seed_of(self.seed, "clutter", i), config=self.clutter) for i in range(len(cameras))
        ]
        for frame in frames:
            images, truth = [], []
            for index, (camera, ray, still, moving) in enumerate(zip(cameras, rays, stills, clutter, strict=True)):
                image, ids, coverage = self._drawn(camera, ray, still, frame)
                if index in self.trees:
                    image, ids, coverage = _canopy(self.size, seed_of(self.seed, index), frame), 0 * ids, 0 * coverage
                image, ids = moving.seen(image, coverage, frame)[0], moving.ids(ids, frame)
                images.append(image)
                truth.append(ids)
            yield FrameSet(frame, frame / 30, tuple(images), (None,) * len(images)), truth

    def _drawn(self, camera, rays, still, frame):
        image, ids, total = still.copy(), np.zeros(still.shape[:2], np.uint16), np.zeros(still.shape[:2], np.float32)
        start, centres = camera.world_from_cam[:3, 3], [flyer.path(frame) for flyer in self.flyers]
        for flyer, centre in zip(self.flyers, centres, strict=True):
            below = centre + _SUN * (centre[2] - GROUND)
            window = _window(camera, below, 2.5 * max(flyer.axes))
            ray = rays[window]
            ground = start + ray * ((GROUND - start[2]) / np.minimum(ray[..., 2], -1e-9))[..., None]
            shaded = _meets(ground - centre, np.broadcast_to(-_SUN, ray.shape), flyer.axes) & (ray[..., 2] < -1e-6)
            image[window][shaded] *= 0.55
        for index in np.argsort([-np.linalg.norm(centre - start) for centre in centres]):
            flyer, centre = self.flyers[index], centres[index]
            window = _window(camera, centre, max(flyer.axes))
            fine = _meets(start - centre, _rays(camera, window, 3), flyer.axes).astype(np.float32)
            share = fine.reshape(fine.shape[0] // 3, 3, -1, 3).mean(axis=(1, 3))
            image[window] += share[..., None] * (np.array(flyer.colour, np.float32) - image[window])
            ids[window][share > 0.5] = index + 1
            total[window] = np.maximum(total[window], share)
        return image, ids, total


def _window(camera: CaptureCamera, centre: np.ndarray, radius: float) -> tuple[slice, slice]:
    """Rows and columns that hold a ball; a column and a row at least."""
    (u, v), size = project_points(centre, camera), (camera.width, camera.height)
    reach = 1.2 * camera.K[0, 0] * radius / np.linalg.norm(centre - camera.world_from_cam[:3, 3]) + 2
    low = np.clip([u - reach, v - reach], 0, np.array(size) - 1).astype(int)
    high = np.clip([u + reach, v + reach], low + 1, size).astype(int)
    return slice(low[1], high[1]), slice(low[0], high[0])


def _rays(camera: CaptureCamera, window: tuple[slice, slice] | None = None, factor: int = 1) -> np.ndarray:
    rows, columns = window or (slice(0, camera.height), slice(0, camera.width))
    along = (np.arange(columns.start * factor, columns.stop * factor) + 0.5) / factor
    down = (np.arange(rows.start * factor, rows.stop * factor) + 0.5) / factor
    pixels = np.stack([*np.meshgrid(along, down), np.ones((len(down), len(along)))], axis=-1)
    return pixels @ np.linalg.inv(camera.K).T @ camera.world_from_cam[:3, :3].T


def _meets(start: np.ndarray, rays: np.ndarray, axes: tuple[float, float, float]) -> np.ndarray:
    """Whether rays from `start` (relative to the centre) meet an ellipsoid, by the discriminant of the quadratic."""
    rays, start = rays / np.array(axes), start / np.array(axes)
    b = np.sum(rays * start, axis=-1)
    return (b * b - np.sum(rays * rays, axis=-1) * (np.sum(start * start, axis=-1) - 1) > 0) & (b < 0)


def _background(
    camera: CaptureCamera, rays: np.ndarray, colour: tuple[float, float, float], mottling: float, seed: int
) -> np.ndarray:
    """A pale sky over mottled ground, sharp to the pixel."""
    rng, shape = np.random.default_rng(seed), rays.shape[:2]
    mottled = sum(
        cv2.resize(rng.normal(size=(shape[0] // s, shape[1] // s)).astype(np.float32), shape[::-1]) for s in (2, 8, 24)
    )
    ground = np.array(colour, np.float32) * (1 + mottling * mottled[..., None])
    up = rays[..., 2] / np.linalg.norm(rays, axis=-1)
    sky = np.stack([0.75 - 0.5 * up, 0.82 - 0.35 * up, 0.95 - 0.2 * up], axis=-1).astype(np.float32)
    return np.clip(np.where(up[..., None] > 0, sky, ground), 0, 1).astype(np.float32)


def _canopy(size: tuple[int, int], seed: int, frame: int) -> np.ndarray:
    """Dark leaves of six pixels, each of which hangs one way or the other in every frame."""
    shape = size[1] // 6, size[0] // 6
    shades = np.random.default_rng(seed).uniform(0.1, 0.25, size=(2, *shape))
    side = np.random.default_rng(seed_of(seed, frame)).integers(0, 2, size=shape)
    grey = cv2.resize(np.take_along_axis(shades, side[None], 0)[0].astype(np.float32), size)
    return grey[..., None] * np.array([0.7, 1.0, 0.5], np.float32)


def circling(radius: float = 2.0, *, rate: float = 0.06, height: float = 0.5, phase: float = 0.0):
    """A path that never ends."""
    return lambda frame: np.array(
        [
            radius * np.cos(rate * frame + phase),
            radius * np.sin(rate * frame + phase),
            height + 0.4 * np.sin(0.11 * frame + phase),
        ]
    )


def cluttered(scene: Scene, **changes: float) -> Scene:
    """The scene with all clutter on."""
    return replace(scene, clutter=replace(ClutterConfig(), **changes))
