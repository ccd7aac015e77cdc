"""Camera rigs: sphere (Sim-1), circle (Sim-2) and line (Sim-3) of thesis §5.3 and §6.3. Host-side, float64."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from jaxtyping import Float

from aerojax.capture.format import CaptureCamera

RigKind = Literal["sphere", "circle", "line"]


@dataclass(frozen=True)
class RigConfig:
    """A rig and its images.

    kind: layout of the cameras.
    cameras: how many, at least 3.
    width, height: pixels.
    span_px: pixels that one metre spans at the target's mean distance (min and max of a uniform draw).
    distance: metres from the cameras to the target (min and max of a uniform draw).
    elevation_deg: of the cameras, seen from the target (sphere and circle; min and max).
    """

    kind: RigKind = "sphere"
    cameras: int = 4
    width: int = 960
    height: int = 540
    span_px: tuple[float, float] = (50.0, 120.0)
    distance: tuple[float, float] = (8.0, 32.0)
    elevation_deg: tuple[float, float] = (-20.0, 20.0)


def look_at(centre: Float[np.ndarray, "3"], target: Float[np.ndarray, "3"]) -> Float[np.ndarray, "4 4"]:
    """`world_from_cam` in float64: +z towards the target, image up towards world +Z (+X where it looks straight up)."""
    forward = (target - centre) / np.linalg.norm(target - centre)
    up = np.array([0.0, 0.0, 1.0]) if abs(forward[2]) < 0.999 else np.array([1.0, 0.0, 0.0])
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    pose[:3, 3] = centre
    return pose


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


def _directions(config: RigConfig, rng: np.random.Generator) -> Float[np.ndarray, "camera 3"]:
    """Unit vectors from the target to the cameras."""
    count = config.cameras
    start = rng.uniform(0.0, 2 * np.pi)
    if config.kind == "line":
        # A straight base seen under ±15° to ±25°, as 50 m are from 80 m and more (Sim-3), slightly off level.
        half = np.deg2rad(rng.uniform(12.0, 25.0))
        side = np.linspace(-np.tan(half), np.tan(half), count)
        elevation = np.deg2rad(rng.uniform(-30.0, 10.0))
        base = np.stack([np.cos(start) - side * np.sin(start), np.sin(start) + side * np.cos(start)], axis=1)
        directions = np.concatenate([base, np.full((count, 1), np.tan(elevation))], axis=1)
        return directions / np.linalg.norm(directions, axis=1, keepdims=True)
    azimuth = start + 2 * np.pi * np.arange(count) / count + rng.uniform(-0.35, 0.35, count)
    low, high = np.deg2rad(config.elevation_deg)
    # The sphere draws each camera's elevation, the circle one for all of them.
    elevation = rng.uniform(low, high, count) if config.kind == "sphere" else np.full(count, rng.uniform(low, high))
    flat = np.cos(elevation)
    return np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)], axis=1)


def draw_rig(config: RigConfig, target: Float[np.ndarray, "3"], rng: np.random.Generator) -> tuple[CaptureCamera, ...]:
    """Cameras that look at `target` (metres, world) with one common focal length.

    The focal length follows from the drawn span and distance: f = span · distance, so that apparent size is
    independent of the class.
    """
    distance = rng.uniform(*config.distance)
    focal = distance * rng.uniform(*config.span_px)
    size = (config.width, config.height)
    cameras = (
        aimed_camera(index, target + distance * direction, target, focal=focal, size=size)
        for index, direction in enumerate(_directions(config, rng))
    )
    return tuple(
        replace(c, mask=f"{c.name}/mask/{{frame:06d}}.png", depth=f"{c.name}/depth/{{frame:06d}}.tiff") for c in cameras
    )
