"""Small factories: few cameras, few pixels, few frames."""

from __future__ import annotations

from typing import Any

from aerojax.pipeline.factory.config import FactoryConfig, FaultRanges, FlightRanges, RigRanges

IDEAL = FaultRanges(
    rotation_deg=(0.0, 0.0),
    position_m=(0.0, 0.0),
    focal_percent=(0.0, 0.0),
    clock_ms=(0.0, 0.0),
    lost=(0, 0),
    mask_threshold=(0.25, 0.25),
    mask_growth=(0, 0),
    sensor=(0.0, 0.0),
)
"""Nothing is wrong; the mask's threshold is the renderer's own."""


def small_factory(**changes: Any) -> FactoryConfig:
    """Two frames before four near cameras, 40 pixels an object."""
    rigs = RigRanges(kinds=("sphere",), cameras=(4, 4), width_px=(40.0, 40.0), distance_m=(8.0, 8.0))
    values = {"individuals": 1, "clips": 1, "frames": 2, "least_frames": 1, "rigs": rigs, "flights": FlightRanges()}
    return FactoryConfig(**{**values, **changes})
