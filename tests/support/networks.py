"""A network of cameras around a solid ellipsoid that moves: frame sets without files."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from aerojax.capture.format import CaptureCamera
from aerojax.core.types import FrameSet
from aerojax.geometry.cameras import look_at

WIDTH, HEIGHT, FOCAL = 160, 120, 220.0
AXES = np.array([0.5, 0.2, 0.12])
"""Half axes of the ellipsoid, metres."""


def network(cameras: int = 4, *, world_from_rig: np.ndarray | None = None) -> tuple[CaptureCamera, ...]:
    """Cameras on a circle of 5 m that look at the origin."""
    placed = np.eye(4) if world_from_rig is None else world_from_rig
    found = []
    for index in range(cameras):
        angle = 2 * np.pi * index / cameras + 0.3
        centre = np.array([5 * np.cos(angle), 5 * np.sin(angle), 1.0 + 0.4 * index])
        found.append(
            CaptureCamera(
                name=f"cam_{index + 1:02d}",
                width=WIDTH,
                height=HEIGHT,
                K=np.array([[FOCAL, 0.0, WIDTH / 2], [0.0, FOCAL, HEIGHT / 2], [0.0, 0.0, 1.0]]),
                distortion_model="none",
                distortion=(),
                world_from_cam=placed @ np.asarray(look_at(centre, np.zeros(3)), np.float64),
                rgb=f"cam_{index + 1:02d}/{{frame:06d}}.png",
                mask=f"cam_{index + 1:02d}/mask/{{frame:06d}}.png",
                depth=None,
                time_offset_s=0.0,
            )
        )
    return tuple(found)


def position_at(frame: int) -> np.ndarray:
    """The ellipsoid's centre, metres: a slow circle that never ends."""
    return np.array([0.9 * np.cos(0.1 * frame), 0.9 * np.sin(0.1 * frame), 0.05 * np.sin(0.23 * frame)])


def mask_of(camera: CaptureCamera, centre: np.ndarray, axes: np.ndarray = AXES) -> np.ndarray:
    """Pixels whose ray meets the ellipsoid, by the discriminant of the quadratic."""
    columns, rows = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
    pixels = np.stack([columns, rows, np.ones_like(columns)], axis=-1)
    rays = pixels @ np.linalg.inv(camera.K).T @ camera.world_from_cam[:3, :3].T / axes
    start = (camera.world_from_cam[:3, 3] - centre) / axes
    b = rays @ start
    return b * b - np.sum(rays * rays, axis=-1) * (start @ start - 1) > 0


def frame_sets(
    cameras: tuple[CaptureCamera, ...],
    frames: range,
    *,
    masks: bool = True,
    blind: tuple[int, ...] = (),
    watching: tuple[int, ...] | None = None,
    instance: int = 3,
) -> Iterator[FrameSet]:
    """The ellipsoid, bright before a grey gradient, at 30 frames a second; in `blind` frames nobody sees anything, in
    the others those cameras that are `watching`, or all."""
    backdrop = np.repeat(np.linspace(0.2, 0.5, WIDTH, dtype=np.float32)[None, :, None], HEIGHT, 0).repeat(3, 2)
    for frame in frames:
        awake = [frame not in blind and (watching is None or index in watching) for index in range(len(cameras))]
        seen = [mask_of(c, position_at(frame)) & looks for c, looks in zip(cameras, awake, strict=True)]
        rgb = tuple(np.where(mask[..., None], np.float32(0.9), backdrop) for mask in seen)
        ids = tuple(instance * mask.astype(np.uint16) for mask in seen) if masks else (None,) * len(cameras)
        yield FrameSet(frame, frame / 30, rgb, ids)
