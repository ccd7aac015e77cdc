"""Identities: who is in which split, and the USD file of each.

Families belong to one split, so that a validation or test identity is a new kind of object, not a new draw of a known
one.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aerojax.errors import UserError
from aerojax.simulate.assets import airplanes, birds, helicopters, multicopters
from aerojax.simulate.assets.authoring import Asset, write_asset
from aerojax.simulate.assets.skeletons import write_skinned
from aerojax.simulate.assets.variation import seed_of
from aerojax.types import CLASSES

FAMILIES: dict[str, dict[str, tuple[str, ...]]] = {
    "bird": {
        "train": ("passerine", "gull", "buzzard", "goose", "pigeon", "heron", "swift", "albatross"),
        "val": ("crow", "falcon"),
        "test": ("eagle", "stork", "duck"),
    },
    "drone": {
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
        ),
        "val": ("octocopter", "h_frame"),
        "test": ("dead_cat", "coaxial_y6"),
    },
    "airplane": {
        "train": (
            "high_wing_trainer",
            "airliner",
            "low_wing_sport",
            "fighter",
            "glider",
            "twin_prop",
            "business_jet",
            "foam_flyer",
            "flying_wing",
        ),
        "val": ("commuter", "canard_delta"),
        "test": ("biplane", "twin_boom"),
    },
    "helicopter": {
        "train": ("light_piston", "transport", "light_turbine", "attack", "pod_and_boom", "fenestron", "tandem"),
        "val": ("heavy_transport", "utility"),
        "test": ("open_frame", "coaxial"),
    },
}
"""Class, split, families. The commonest kinds and the extremes train (longest wings, fewest arms, most rotors), so that
kinds seen only in validation or test lie between kinds that were trained on."""


@dataclass(frozen=True)
class Identity:
    """One individual object.

    name: unique, also the stem of its file.
    label: one of `aerojax.types.CLASSES`.
    family: the ranges that its parameters are drawn from.
    seed: of its shape, motion and colours.
    split: "train", "val" or "test".
    """

    name: str
    label: str
    family: str
    seed: int
    split: str


def identities(split: str, per_class: int) -> tuple[Identity, ...]:
    """The first `per_class` individuals of every class, classes and families interleaved.

    A larger `per_class` extends the same list, so files that exist stay valid.

    Raises:
        UserError: if `split` is unknown or `per_class` is negative.
    """
    if split not in ("train", "val", "test"):
        raise UserError(f"split is {split!r}; use train, val or test")
    if per_class < 0:
        raise UserError(f"per_class is {per_class}; it counts identities of a class and cannot be negative")
    return tuple(_identity(split, label, index) for index in range(per_class) for label in CLASSES)


def _identity(split: str, label: str, index: int) -> Identity:
    families = FAMILIES[label][split]
    family, number = families[index % len(families)], index // len(families)
    seed = seed_of("aerojax", split, label, family, number)
    return Identity(f"{label}_{family}_{number:02d}", label, family, seed, split)


def build_identity(identity: Identity, folder: Path) -> Path:
    """Write `<folder>/<name>.usdc` unless it is there already, and return its path.

    The file appears in one step, so several processes may build into one folder.

    Raises:
        UserError: if the identity names an unknown class or family.
    """
    path = folder / f"{identity.name}.usdc"
    families = FAMILIES.get(identity.label, {})
    if not any(identity.family in names for names in families.values()):
        raise UserError(f"identity {identity.name}: no family {identity.family!r} of class {identity.label!r}")
    if path.exists():
        return path
    rng = np.random.default_rng(identity.seed)
    colour_seed = seed_of("colours", identity.seed)
    if identity.label == "bird":
        write_skinned(path, birds.author(birds.draw_parameters(identity.family, rng)), colour_seed)
    else:
        write_asset(path, _author(identity, rng), colour_seed)
    return path


def _author(identity: Identity, rng: np.random.Generator) -> Asset:
    """Draw and build an asset whose moving parts are rotors."""
    if identity.label == "drone":
        return multicopters.author(multicopters.draw_parameters(identity.family, rng), rng)
    if identity.label == "helicopter":
        return helicopters.author(helicopters.draw_parameters(identity.family, rng), rng)
    return airplanes.author(airplanes.draw_parameters(identity.family, rng), rng)
