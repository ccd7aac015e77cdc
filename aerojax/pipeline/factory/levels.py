"""Levels of one fault each: what a curve of accuracy against a fault is made from."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from aerojax.core.errors import UserError
from aerojax.pipeline.factory.config import FactoryConfig, FaultRanges, FlightRanges, RigRanges
from aerojax.pipeline.factory.plan import clip_name
from aerojax.pipeline.factory.write import individuals_of
from aerojax.simulate.assets.catalogue import Identity

BASE = "ideal"
"""The level at which nothing is wrong."""
NO_TURN = 1e-9
"""Degrees of a right calibration: nothing to see, but exactly 0 would skip draws and change all that are after them."""

IDEAL_RIGS = RigRanges(cameras=(8, 8), width_px=(80.0, 80.0), distance_m=(32.0, 32.0), field_deg=(45.0, 45.0))
"""80 pixels at 32 m are a camera of about the published Sim-1 (2,802 pixels of focal length, objects of 1 m)."""
SHORT_FLIGHTS = FlightRanges(max_travel=(1.0, 1.5))
"""A path that every one of the rigs has room for: at 16 m, 45° show 7 m and the nearest camera less."""
NO_FAULTS = FaultRanges(
    rotation_deg=(NO_TURN, NO_TURN),
    position_m=(0.0, 0.0),
    focal_percent=(0.0, 0.0),
    clock_ms=(0.0, 0.0),
    lost=(0, 0),
    mask_threshold=(0.25, 0.25),  # the renderer's own
    mask_growth=(0, 0),
    sensor=(0.0, 0.0),
)


@dataclass(frozen=True)
class CurveLevels:
    """The values of each curve; a level that is the ideal one is made once.

    calibration_deg: standard deviation of the stated rotations. clock_ms: largest unstated offset of a clock.
    mask_growth: pixels of dilation, of erosion where negative. cameras: that record, of those of the ideal rig.
    width_px: that the object spans, by another focal length. distance_m: of the same cameras, so that the width falls.
    combined: calibration (degrees), clock (ms) and cameras lost, all at once; empty for none.
    """

    calibration_deg: tuple[float, ...] = (0.0, 0.1, 0.3, 0.5, 1.0, 2.0)
    clock_ms: tuple[float, ...] = (0.0, 5.0, 10.0, 33.0, 66.0)
    mask_growth: tuple[int, ...] = (-3, -2, -1, 0, 1, 2, 3)
    cameras: tuple[int, ...] = (8, 7, 6, 5, 4, 3)
    width_px: tuple[float, ...] = (8.0, 12.0, 16.0, 24.0, 40.0, 80.0, 160.0)
    distance_m: tuple[float, ...] = (16.0, 64.0, 140.0, 280.0)
    combined: tuple[float, ...] = (0.3, 10.0, 1.0)


@dataclass(frozen=True)
class Level:
    """One point of a curve: `value` of `factor`, in the units of `CurveLevels`; `folder` holds its clips."""

    factor: str
    value: float
    folder: str
    config: FactoryConfig


@dataclass(frozen=True, kw_only=True)
class LevelsConfig:
    """What is made.

    factory: the ideal: every range is one value, or a draw that is the same at every level.
    curves: the levels.
    """

    factory: FactoryConfig = field(
        default_factory=lambda: FactoryConfig(
            split="test", individuals=15, clips=1, rigs=IDEAL_RIGS, flights=SHORT_FLIGHTS, faults=NO_FAULTS
        )
    )
    curves: CurveLevels = field(default_factory=CurveLevels)

    @property
    def margin(self) -> int:
        """Frames around every flight: enough for the slowest clock, so that all levels have one flight."""
        slowest = max((*self.curves.clock_ms, *self.curves.combined[1:2]), default=0.0)
        fastest = max(self.factory.flights.usual_fps, *self.factory.flights.fps)
        return 1 + math.ceil(slowest / 1e3 * fastest)


def levels_of(config: LevelsConfig) -> tuple[Level, ...]:
    """Every point of every curve; those that change nothing share the folder of the ideal.

    Raises:
        UserError: a number of cameras that the ideal rig does not have, or the wrong number of combined faults.
    """
    most, curves = config.factory.rigs.cameras[1], config.curves
    if not all(config.factory.pipeline.min_views <= count <= most for count in curves.cameras):
        problem, ends = f"curves.cameras is {list(curves.cameras)}", f"{config.factory.pipeline.min_views} to {most}"
        raise UserError("out-of-range", problem, f"use {ends}, or another factory.rigs.cameras")
    if len(curves.combined) not in (0, 3):
        raise UserError("invalid", f"curves.combined is {list(curves.combined)}", "give degrees, ms and cameras, or []")
    points = [(name, value) for name, values in vars(curves).items() if name != "combined" for value in values]
    found = [_level(config.factory, name, float(value)) for name, value in points]
    if curves.combined:
        turn, clock, lost = curves.combined
        faults = _faults(config.factory, rotation_deg=turn, clock_ms=clock, lost=int(lost))
        found.append(Level("combined", 1.0, "combined_{:g}_{:g}_{:g}".format(*curves.combined), faults))
    return (Level(BASE, 0.0, BASE, config.factory), *found)


def _level(ideal: FactoryConfig, factor: str, value: float) -> Level:
    changed = _CHANGES[factor](ideal, value)
    return Level(factor, value, BASE if changed == ideal else f"{factor}_{value:g}", changed)


def _faults(ideal: FactoryConfig, **values: float | int) -> FactoryConfig:
    ends: dict[str, Any] = {name: (value, value) for name, value in values.items()}
    return replace(ideal, faults=replace(ideal.faults, **ends))


def _at_width(ideal: FactoryConfig, pixels: float) -> FactoryConfig:
    return replace(ideal, rigs=replace(ideal.rigs, width_px=(pixels, pixels)))


def _at_distance(ideal: FactoryConfig, metres: float) -> FactoryConfig:
    scale = ideal.rigs.distance_m[0] / metres
    low, high = (width * scale for width in ideal.rigs.width_px)
    return replace(ideal, rigs=replace(ideal.rigs, distance_m=(metres, metres), width_px=(low, high)))


_CHANGES: Mapping[str, Callable[[FactoryConfig, float], FactoryConfig]] = {
    "calibration_deg": lambda ideal, value: _faults(ideal, rotation_deg=max(value, NO_TURN)),
    "clock_ms": lambda ideal, value: _faults(ideal, clock_ms=value),
    "mask_growth": lambda ideal, value: _faults(ideal, mask_growth=int(value)),
    "cameras": lambda ideal, value: _faults(ideal, lost=ideal.rigs.cameras[1] - int(value)),
    "width_px": _at_width,
    "distance_m": _at_distance,
}


def names_of(config: LevelsConfig) -> list[tuple[str, Identity]]:
    """Name and individual of every clip that a level should have."""
    pairs = ((one, index) for one in individuals_of(config.factory) for index in range(config.factory.clips))
    return [(clip_name(one, index), one) for one, index in pairs]
