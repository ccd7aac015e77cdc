"""Identities: who is in which split, and the USD file of each.

Families belong to one split, so that a validation or test identity is a new kind of object, not a new draw of a known
one.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aerojax.core.errors import UserError
from aerojax.core.types import CLASSES
from aerojax.simulate.assets.airplanes import author as airplanes
from aerojax.simulate.assets.airplanes import families as airplane_families
from aerojax.simulate.assets.birds import author as birds
from aerojax.simulate.assets.birds import families as bird_families
from aerojax.simulate.assets.helicopters import author as helicopters
from aerojax.simulate.assets.helicopters import families as helicopter_families
from aerojax.simulate.assets.importers.convert import convert_model
from aerojax.simulate.assets.importers.models import ImportedModel
from aerojax.simulate.assets.multicopters import author as multicopters
from aerojax.simulate.assets.multicopters import families as multicopter_families
from aerojax.simulate.assets.variation import seed_of
from aerojax.simulate.usd.authoring import Asset, write_asset
from aerojax.simulate.usd.skeletons import write_skinned

TABLE: dict[str, dict[str, int]] = {
    "bird": {"train": 15, "val": 6, "test": 8},
    "drone": {"train": 15, "val": 7, "test": 8},
    "airplane": {"train": 8, "val": 4, "test": 4},
    "helicopter": {"train": 8, "val": 4, "test": 4},
}
"""Class, split, number of identities: 91 in all (thesis Table 6.3)."""

SPLITS: dict[str, dict[str, tuple[str, ...]]] = {
    "bird": bird_families.SPLITS,
    "drone": multicopter_families.SPLITS,
    "airplane": airplane_families.SPLITS,
    "helicopter": helicopter_families.SPLITS,
}
"""Class, split, families. The commonest kinds and the extremes train (longest wings, fewest arms, most rotors), so that
kinds seen only in validation or test lie between kinds that were trained on."""


@dataclass(frozen=True)
class Identity:
    """One individual object.

    name: unique, also the stem of its file.
    label: one of `aerojax.core.types.CLASSES`.
    family: the ranges that its parameters are drawn from.
    seed: of its shape, motion and colours.
    split: "train", "val" or "test".
    model: a user's own model that it is made of instead of a family; None for a procedural one.
    """

    name: str
    label: str
    family: str
    seed: int
    split: str
    model: ImportedModel | None = None


def identities(split: str, per_class: int | None = None, *, per_family: int = 1) -> tuple[Identity, ...]:
    """The individuals of a split; without further arguments the data set's own, one a family (`TABLE`).

    Args:
        split: "train", "val" or "test".
        per_class: exactly so many individuals of every class, families in turn, for balanced training; a larger number
            extends the same list.
        per_family: so many individuals of every family; the first ones are those of a smaller number.

    Returns:
        Classes and families interleaved, so that the beginning of the list holds every class.

    Raises:
        UserError: if `split` is unknown, a count is negative, or both counts are given.
    """
    if split not in ("train", "val", "test"):
        raise UserError("out-of-range", f"split is {split!r}", "use train, val or test")
    if min(per_class or 0, per_family) < 0:
        name, count = ("per_family", per_family) if per_family < 0 else ("per_class", per_class)
        raise UserError("invalid", f"{name} is {count}", "it counts identities and cannot be negative")
    if per_class is not None and per_family != 1:
        raise UserError("invalid", "per_class and per_family are both set", "use one of them")
    counts = {
        label: per_class if per_class is not None else per_family * len(SPLITS[label][split]) for label in CLASSES
    }
    return tuple(
        _identity(split, label, index)
        for index in range(max(counts.values()))
        for label in CLASSES
        if index < counts[label]
    )


def _identity(split: str, label: str, index: int) -> Identity:
    families = SPLITS[label][split]
    family, number = families[index % len(families)], index // len(families)
    seed = seed_of("aerojax", split, label, family, number)
    return Identity(f"{label}_{family}_{number:02d}", label, family, seed, split)


def build_identity(identity: Identity, folder: Path) -> Path:
    """Write `<folder>/<name>.usdc` and its texture `<name>.png` unless they are there already; return the stage's path.

    The stage appears in one step and after its texture, so several processes may build into one folder.

    Raises:
        UserError: if the identity names an unknown class or family, or its own model cannot be converted.
    """
    path = folder / f"{identity.name}.usdc"
    if identity.model is not None:
        convert_model(identity.model, path)
        return path
    families = SPLITS.get(identity.label, {})
    if not any(identity.family in names for names in families.values()):
        raise UserError(
            "invalid",
            f"identity {identity.name}: no family {identity.family!r} of class {identity.label!r}",
            "choose a family of the catalogue",
        )
    if path.exists() and path.with_suffix(".png").exists():
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
