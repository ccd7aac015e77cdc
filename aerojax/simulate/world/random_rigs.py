"""Camera rigs drawn at random in the layouts of thesis §5.3 and §6.3, for training and samples. Host-side, float64."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from aerojax.capture.format import CaptureCamera
from aerojax.simulate.world.rigs import RigKind, aimed_camera


@dataclass(frozen=True)
class RandomRigConfig:
    """A rig whose directions, distance and focal length are drawn, and its images.

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


def _directions(config: RandomRigConfig, rng: np.random.Generator) -> Float[np.ndarray, "camera 3"]:
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


def draw_rig(
    config: RandomRigConfig, target: Float[np.ndarray, "3"], rng: np.random.Generator
) -> tuple[CaptureCamera, ...]:
    """Cameras that look at `target` (metres, world) with one common focal length.

    The focal length follows from the drawn span and distance: f = span · distance, so that apparent size is
    independent of the class.
    """
    distance = rng.uniform(*config.distance)
    focal = distance * rng.uniform(*config.span_px)
    size = (config.width, config.height)
    return tuple(
        aimed_camera(index, target + distance * direction, target, focal=focal, size=size)
        for index, direction in enumerate(_directions(config, rng))
    )
