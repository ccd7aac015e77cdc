"""Multicopter families: ranges (lengths over the motor diagonal, degrees; see `MulticopterParameters`) and splits."""

from __future__ import annotations

from typing import Any

from aerojax.simulate.assets.multicopters.families_enclosed import ENCLOSED
from aerojax.simulate.assets.multicopters.families_frames import FRAMES
from aerojax.simulate.assets.multicopters.families_work import WORK

FAMILIES: dict[str, dict[str, Any]] = FRAMES | WORK | ENCLOSED

SPLITS: dict[str, tuple[str, ...]] = {
    "train": (
        "camera_quad",
        "racing_quad",
        "hexacopter",
        "micro_quad",
        "research_quad",
        "tricopter",
        "guarded_quad",
        "heavy_lift",
        "coaxial_x8",
        "folding_quad",
        "cinewhoop",
        "sprayer",
        "caged_quad",
        "plus_quad",
        "air_taxi",
    ),
    "val": ("octocopter", "h_frame", "lidar_mapper", "whoop", "spider_hexa", "v_tail_quad", "parachute_hexa"),
    "test": (
        "dead_cat",
        "coaxial_y6",
        "parcel_octo",
        "raised_arm_quad",
        "sling_quad",
        "ring_hexa",
        "fuselage_quad",
        "grille_quad",
    ),
}
"""Which families each split draws from, in the order of the identities."""
