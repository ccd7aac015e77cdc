"""Helicopter families: ranges (lengths over the fuselage length, degrees; see `HelicopterParameters`) and splits."""

from __future__ import annotations

from typing import Any

from aerojax.simulate.assets.helicopters.families_heavy import HEAVY_KINDS
from aerojax.simulate.assets.helicopters.families_light import LIGHT_KINDS

FAMILIES: dict[str, dict[str, Any]] = LIGHT_KINDS | HEAVY_KINDS

SPLITS: dict[str, tuple[str, ...]] = {
    "train": (
        "light_piston",
        "transport",
        "light_turbine",
        "attack",
        "pod_and_boom",
        "fenestron",
        "tandem",
        "sky_crane",
    ),
    "val": ("heavy_transport", "utility", "twin_fin_jet", "synchropter"),
    "test": ("open_frame", "coaxial", "executive", "aerobatic_model"),
}
"""Which families each split draws from, in the order of the identities."""
