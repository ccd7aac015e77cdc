"""Every airplane family with its ranges, and the split that it belongs to."""

from __future__ import annotations

from typing import Any

from aerojax.simulate.assets.airplanes import families_jets as airplane_families_jets
from aerojax.simulate.assets.airplanes import families_propellers as airplane_families_propellers

FAMILIES: dict[str, dict[str, Any]] = airplane_families_propellers.FAMILIES | airplane_families_jets.FAMILIES
"""Lengths over the wing span, angles in degrees (see `AirplaneParameters`)."""

SPLITS: dict[str, tuple[str, ...]] = {
    "train": (
        "high_wing_trainer",
        "airliner",
        "low_wing_sport",
        "fighter",
        "glider",
        "twin_prop",
        "foam_flyer",
        "flying_wing",
    ),
    "val": ("commuter", "canard_delta", "business_jet", "floatplane"),
    "test": ("biplane", "twin_boom", "jet_bomber", "ultralight"),
}
"""Families of each split, in the order in which identities are taken."""
