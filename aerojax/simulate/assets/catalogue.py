"""Identities: who is in which split, and the USD file of each.

Families belong to one split, so that a validation or test identity is a new kind of object, not a new draw of a known
one. The commonest kinds and the extremes train (longest wings, fewest arms, most rotors), so that kinds seen only in
validation or test lie between kinds that were trained on. One identity a family makes 91 in all (thesis Table 6.3).
Any number of further training individuals mixes the training families of a class (`training_individual`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aerojax.core.errors import UserError
from aerojax.core.seeds import seed_of
from aerojax.core.types import CLASSES, UNKNOWN
from aerojax.data.splits import SPLITS, Split
from aerojax.simulate.assets.airplanes.asset import build_airplane
from aerojax.simulate.assets.airplanes.families import airplane_families, draw_airplane
from aerojax.simulate.assets.birds.asset import build_bird
from aerojax.simulate.assets.birds.families import bird_families, draw_bird
from aerojax.simulate.assets.families import Family, names_by_split
from aerojax.simulate.assets.helicopters.asset import build_helicopter
from aerojax.simulate.assets.helicopters.families import draw_helicopter, helicopter_families
from aerojax.simulate.assets.hybrids.individuals import HYBRID, hybrid_asset
from aerojax.simulate.assets.importers.convert import convert_model
from aerojax.simulate.assets.importers.models import ImportedModel
from aerojax.simulate.assets.multicopters.asset import build_multicopter
from aerojax.simulate.assets.multicopters.families import draw_multicopter, multicopter_families
from aerojax.simulate.assets.outliers.individuals import outlier_asset
from aerojax.simulate.assets.outliers.kinds import KINDS
from aerojax.simulate.usd.authoring import Asset, write_asset
from aerojax.simulate.usd.skeletons import SkinnedAsset, write_skinned

_FAMILIES: dict[str, Callable[[], dict[str, Family]]] = {
    "bird": bird_families,
    "drone": multicopter_families,
    "airplane": airplane_families,
    "helicopter": helicopter_families,
}


def families_of(label: str) -> dict[str, Family]:
    """Every procedural family of a class by name; those of a split in the order in which identities take them.

    Raises:
        KeyError: if `label` is no class.
    """
    return _FAMILIES[label]()


@dataclass(frozen=True)
class Identity:
    """One individual object.

    name: unique, also the stem of its file.
    label: one of `aerojax.core.types.CLASSES`, or `UNKNOWN` for an outlier.
    family: the ranges that its parameters are drawn from; the kind of an outlier.
    seed: of its shape, motion and colours.
    split: of the family, or as the list of models says.
    model: a user's own model that it is made of instead of a family; None for a procedural one.
    """

    name: str
    label: str
    family: str
    seed: int
    split: Split
    model: ImportedModel | None = None

    @property
    def moves_like(self) -> str:
        """Its class, or the kind of an outlier; see `world.passive_flight.draw_motion`."""
        return self.family if self.label == UNKNOWN else self.label


def identities(split: str, per_class: int | None = None, *, per_family: int = 1) -> tuple[Identity, ...]:
    """The individuals of a split; without further arguments the data set's own, one a family.

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
    part = next((known for known in SPLITS if known == split), None)
    if part is None:
        raise UserError("out-of-range", f"split is {split!r}", "use train, val or test")
    if min(per_class or 0, per_family) < 0:
        name, count = ("per_family", per_family) if per_family < 0 else ("per_class", per_class)
        raise UserError("invalid", f"{name} is {count}", "it counts identities and cannot be negative")
    if per_class is not None and per_family != 1:
        raise UserError("invalid", "per_class and per_family are both set", "use one of them")
    names = {label: names_by_split(families_of(label))[part] for label in CLASSES}
    counts = {label: per_family * len(names[label]) if per_class is None else per_class for label in CLASSES}
    return tuple(
        _identity(part, label, names[label], index)
        for index in range(max(counts.values()))
        for label in CLASSES
        if index < counts[label]
    )


def _identity(split: Split, label: str, families: tuple[str, ...], index: int) -> Identity:
    family, number = families[index % len(families)], index // len(families)
    seed = seed_of("aerojax", split, label, family, number)
    return Identity(f"{label}_{family}_{number:02d}", label, family, seed, split)


def training_individual(label: str, index: int, *, seed: int = 0) -> Identity:
    """One of any number of training individuals beyond the published split, a mixture of its class's training families.

    Args:
        label: one of `aerojax.core.types.CLASSES`.
        index: which of the class's individuals; names and shapes are stable whatever others are asked for.
        seed: of the whole series.

    Raises:
        UserError: if `label` is no class, or a number is negative.
    """
    if label not in _FAMILIES:
        raise UserError("out-of-range", f"label is {label!r}", f"use one of {', '.join(CLASSES)}")
    if min(index, seed) < 0:
        raise UserError("invalid", f"index is {index} and seed {seed}", "they count from 0")
    name = f"{label}_{HYBRID}_{seed}_{index:06d}"
    return Identity(name, label, HYBRID, seed_of("aerojax", HYBRID, label, seed, index), "train")


def outliers(split: str, per_kind: int = 1) -> tuple[Identity, ...]:
    """Individuals of none of the classes, which no split of `identities` has.

    Args:
        split: "val" for the kinds by which a score and its level are chosen, "test" for those that measure them.
        per_kind: so many of every kind; a larger number extends the list.

    Returns:
        Kinds in turn.

    Raises:
        UserError: if there are no outliers of that split, or the count is negative.
    """
    part = next((known for known in SPLITS if known == split), None)
    kinds = [name for name, kind in KINDS.items() if kind.split == part]
    if part is None or not kinds:
        raise UserError("out-of-range", f"split is {split!r}, and outliers are never learnt from", "use val or test")
    if per_kind < 0:
        raise UserError("invalid", f"per_kind is {per_kind}", "it counts identities and cannot be negative")
    return tuple(
        Identity(f"{kind}_outlier_{n:03d}", UNKNOWN, kind, seed_of("aerojax", "outlier", kind, n), part)
        for n in range(per_kind)
        for kind in kinds
    )


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
    if path.exists() and path.with_suffix(".png").exists():
        return path
    asset = asset_of(identity)
    if isinstance(asset, SkinnedAsset):
        write_skinned(path, asset, colour_seed_of(identity))
    else:
        write_asset(path, asset, colour_seed_of(identity))
    return path


def colour_seed_of(identity: Identity) -> int:
    """The seed of a procedural identity's palette and patterns."""
    return seed_of("colours", identity.seed)


def asset_of(identity: Identity) -> Asset | SkinnedAsset:
    """The parts and the motion of a procedural identity, in memory.

    Raises:
        UserError: if the identity names an unknown class or family.
    """
    if identity.label == UNKNOWN and identity.family in KINDS:
        return outlier_asset(identity.family, identity.seed)
    if identity.label in _FAMILIES and identity.family == HYBRID and identity.split == "train":
        return hybrid_asset(identity.label, identity.seed)
    if identity.label not in _FAMILIES or identity.family not in families_of(identity.label):
        raise UserError(
            "invalid",
            f"identity {identity.name}: no family {identity.family!r} of class {identity.label!r}",
            "choose a family of the catalogue",
        )
    rng = np.random.default_rng(identity.seed)
    if identity.label == "bird":
        return build_bird(draw_bird(identity.family, rng))
    if identity.label == "drone":
        return build_multicopter(draw_multicopter(identity.family, rng), rng)
    if identity.label == "helicopter":
        return build_helicopter(draw_helicopter(identity.family, rng), rng)
    return build_airplane(draw_airplane(identity.family, rng), rng)
