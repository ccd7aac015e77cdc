"""Fixed camera rigs of the thesis (§5.3, §6.3): a sphere (Sim-1), a circle (Sim-2), a line (Sim-3).

Host-side, float64. `random_rigs` draws rigs instead.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from aerojax.capture.format import CaptureCamera
from aerojax.core.errors import UserError
from aerojax.simulate.world.rigs import RigKind, aimed_camera


@dataclass(frozen=True)
class FixedRigConfig:
    """Cameras at fixed places. A sphere or circle may have several radii (and elevations), each a condition of its own.

    kind: layout. cameras: how many, at least 3.
    width, height: pixels. focal_px: focal length in pixels, the same along both axes.
    radii: metres from `aim` (sphere) or from the vertical axis through it (circle).
    elevations_deg: of the cameras of a sphere, seen from `aim`.
    azimuth_deg: of the first camera of a sphere or circle.
    camera_height: metres over the ground (circle, line).
    baseline: metres between the ends of a line, which lies along the world's y axis at x = 0.
    aim: the point that all cameras look at, metres, world.
    """

    kind: RigKind
    cameras: int
    width: int
    height: int
    focal_px: float
    radii: tuple[float, ...] = ()
    elevations_deg: tuple[float, ...] = (0.0,)
    azimuth_deg: float = 0.0
    camera_height: float = 0.0
    baseline: float = 0.0
    aim: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Condition:
    """One placement of a fixed rig: its name in sequence names, radius (metres) and elevation (degrees)."""

    name: str
    radius: float
    elevation_deg: float


def conditions(config: FixedRigConfig) -> tuple[Condition, ...]:
    """Every combination of radius and elevation, radii first; one for a line.

    Raises:
        UserError: fewer than 3 cameras, or no radius where one is needed.
    """
    if config.cameras < 3:
        raise UserError("out-of-range", f"rig.fixed.cameras is {config.cameras}", "a network needs at least 3")
    if config.kind == "line":
        return (Condition("", 0.0, 0.0),)
    if not config.radii or min(config.radii) <= 0:
        raise UserError(
            "out-of-range", f"rig.fixed.radii is {list(config.radii)}", "name at least one positive radius in metres"
        )
    if config.kind == "circle":
        single = len(config.radii) == 1
        return tuple(Condition("" if single else f"r{radius:03g}", radius, 0.0) for radius in config.radii)
    return tuple(
        Condition(f"r{radius:03g}_e{elevation:g}", radius, elevation)
        for radius in config.radii
        for elevation in config.elevations_deg
    )


def place_cameras(config: FixedRigConfig, condition: Condition) -> tuple[CaptureCamera, ...]:
    """The cameras of one condition, with patterns for colour alone (`capture_patterns` adds the others)."""
    aim, size = np.array(config.aim), (config.width, config.height)
    return tuple(
        aimed_camera(index, centre, aim, focal=config.focal_px, size=size)
        for index, centre in enumerate(_centres(config, condition))
    )


def _centres(config: FixedRigConfig, condition: Condition) -> Float[np.ndarray, "camera 3"]:
    count, aim = config.cameras, np.array(config.aim)
    if config.kind == "line":
        along = np.linspace(-config.baseline / 2, config.baseline / 2, count)
        return np.stack([np.zeros(count), along, np.full(count, config.camera_height)], axis=1)
    azimuth = np.deg2rad(config.azimuth_deg) + 2 * np.pi * np.arange(count) / count
    around = np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros(count)], axis=1)
    if config.kind == "circle":
        return np.array([aim[0], aim[1], config.camera_height]) + condition.radius * around
    elevation = np.deg2rad(condition.elevation_deg)
    return aim + condition.radius * (np.cos(elevation) * around + np.array([0.0, 0.0, np.sin(elevation)]))
