"""Every bird family with its ranges, and the split that it belongs to."""

from __future__ import annotations

from typing import Any

from aerojax.simulate.assets.birds import families_land as bird_families_land
from aerojax.simulate.assets.birds import families_raptors as bird_families_raptors
from aerojax.simulate.assets.birds import families_water as bird_families_water

FAMILIES: dict[str, dict[str, Any]] = (
    bird_families_land.FAMILIES | bird_families_raptors.FAMILIES | bird_families_water.FAMILIES
)
"""Lengths over the wing span, angles in degrees, mass and span of the living bird (see `BirdShape` and `WingBeat`)."""

SPLITS: dict[str, tuple[str, ...]] = {
    "train": (
        "passerine",
        "gull",
        "buzzard",
        "goose",
        "pigeon",
        "heron",
        "swift",
        "albatross",
        "owl",
        "flamingo",
        "frigatebird",
        "pheasant",
        "vulture",
        "woodpecker",
        "hummingbird",
    ),
    "val": ("crow", "falcon", "swallow", "pelican", "parrot", "sandpiper"),
    "test": ("eagle", "stork", "duck", "tern", "kite", "swan", "kingfisher", "hoopoe"),
}
"""Families of each split, in the order in which identities are taken. The extremes train (longest wings, necks, legs
and tails, fastest and slowest beats), so that the other splits hold new kinds within that range."""
