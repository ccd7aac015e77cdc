"""Whether test identities were seen in training: by name, by file, and by shape (thesis section 6.3.1)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from aerojax.core.errors import UserError
from aerojax.core.files import sha256_of_file
from aerojax.data.manifest import DatasetEntries, IdentityEntry


@dataclass(frozen=True, eq=False)
class Embedded:
    """An identity and embeddings of its shape, each from other surface points at other phases of its animation."""

    entry: IdentityEntry
    samplings: Float[np.ndarray, "sampling feature"]

    def own(self) -> Float[np.ndarray, "pair"]:
        """Distances between two samplings of this individual."""
        first, second = np.triu_indices(len(self.samplings), 1)
        return np.linalg.norm(self.samplings[first] - self.samplings[second], axis=1)

    def distance(self, other: Embedded) -> float:
        """Median distance between a sampling of this individual and one of another."""
        apart = self.samplings[:, None] - other.samplings[None]
        return float(np.median(np.linalg.norm(apart, axis=2)))


@dataclass(frozen=True)
class Neighbour:
    """The training identity of the same class that is nearest to an identity.

    distance: between samplings of the two, median.
    resampling: largest distance between two samplings of one of them.
    """

    identity: str
    nearest: str
    distance: float
    resampling: float

    @property
    def ratio(self) -> float:
        """Distance over that of resampling: below 1 the two cannot be told from one individual."""
        return self.distance / max(self.resampling, 1e-12)


@dataclass(frozen=True)
class ClassDistances:
    """Nearest-neighbour distances of one class.

    train_to_train: smallest and median, between different families; NaN where training has fewer than two families.
    test_to_train: smallest and median of the held-out identities.
    resampling: median and largest distance between two samplings of one individual.
    ratio: smallest and median of the held-out identities' ratios.
    """

    label: str
    train_to_train: tuple[float, float]
    test_to_train: tuple[float, float]
    resampling: tuple[float, float]
    ratio: tuple[float, float]


@dataclass(frozen=True)
class Leakage:
    """What crosses the border between splits.

    shared_names, shared_families: found in more than one split. shared_files: groups of assets with equal bytes.
    out_of_split: sequences that show an object of another split.
    copies: held-out shapes that cannot be told from a training identity's by more than samplings of one individual.
    """

    identities: int
    shared_names: tuple[str, ...]
    shared_families: tuple[str, ...]
    shared_files: tuple[tuple[str, ...], ...]
    out_of_split: tuple[str, ...]
    copies: tuple[Neighbour, ...]
    by_class: tuple[ClassDistances, ...]
    neighbours: tuple[Neighbour, ...]


def leakage(entries: DatasetEntries, shapes: Sequence[Embedded]) -> Leakage:
    """Check names, families, files and shapes.

    Args:
        entries: the data sets; an identity may be listed once a data set.
        shapes: an embedding of every identity that is to be compared.

    Raises:
        UserError: an asset cannot be read.
    """
    everyone = entries.identities
    split_of = {identity.name: identity.split for identity in everyone}
    train = [item for item in shapes if item.entry.split == "train"]
    held_out = [item for item in shapes if item.entry.split != "train"]
    by_class, neighbours = [], []
    for label in dict.fromkeys(item.entry.label for item in shapes):
        known = [item for item in train if item.entry.label == label]
        found = [_nearest(item, known) for item in held_out if item.entry.label == label and known]
        inner = [_nearest(item, others) for item in known if (others := _other_families(item, known))]
        own = np.concatenate([item.own() for item in shapes if item.entry.label == label])
        by_class.append(_distances(label, inner, found, own))
        neighbours += found
    return Leakage(
        identities=len(split_of),
        shared_names=_in_several_splits([(i.name, i.split) for i in everyone]),
        shared_families=_in_several_splits([(f"{i.label} {i.family}", i.split) for i in everyone]),
        shared_files=_shared_files(everyone),
        out_of_split=tuple(
            s.name for s in entries.sequences if any(split_of.get(name, s.split) != s.split for name in s.objects)
        ),
        copies=tuple(n for n in neighbours if n.ratio <= 1.0),
        by_class=tuple(by_class),
        neighbours=tuple(sorted(neighbours, key=lambda n: n.ratio)),
    )


def _in_several_splits(pairs: Sequence[tuple[str, str]]) -> tuple[str, ...]:
    splits: dict[str, set[str]] = {}
    for name, split in pairs:
        splits.setdefault(name, set()).add(split)
    return tuple(sorted(name for name, found in splits.items() if len(found) > 1))


def _shared_files(identities: Sequence[IdentityEntry]) -> tuple[tuple[str, ...], ...]:
    by_hash: dict[str, dict[str, str]] = {}
    for identity in identities:
        by_hash.setdefault(file_hash(identity.asset), {})[identity.name] = identity.split
    groups = (names for names in by_hash.values() if len(set(names.values())) > 1)
    return tuple(sorted(tuple(sorted(names)) for names in groups))


def file_hash(path: Path) -> str:
    """SHA-256 of a file, in hexadecimal.

    Raises:
        UserError: it cannot be read.
    """
    try:
        return sha256_of_file(path)
    except OSError:
        raise UserError(
            "unreadable", f"{path}: the asset that dataset.json names cannot be read", "generate or copy it again"
        ) from None


def _other_families(item: Embedded, everyone: Sequence[Embedded]) -> list[Embedded]:
    return [other for other in everyone if other.entry.family != item.entry.family]


def _nearest(item: Embedded, others: Sequence[Embedded]) -> Neighbour:
    distances = [item.distance(other) for other in others]
    index = int(np.argmin(distances))
    nearest = others[index]
    resampling = float(max(item.own().max(), nearest.own().max()))
    return Neighbour(item.entry.name, nearest.entry.name, distances[index], resampling)


def _distances(
    label: str, inner: Sequence[Neighbour], outer: Sequence[Neighbour], own: Float[np.ndarray, "pair"]
) -> ClassDistances:
    def ends(values: Sequence[float]) -> tuple[float, float]:
        return (float(min(values)), float(np.median(values))) if values else (np.nan, np.nan)

    return ClassDistances(
        label,
        ends([n.distance for n in inner]),
        ends([n.distance for n in outer]),
        (float(np.median(own)), float(own.max())),
        ends([n.ratio for n in outer]),
    )


def verdict(found: Leakage) -> Mapping[str, bool]:
    """Whether each check passes."""
    return {
        "names are disjoint": not found.shared_names,
        "families are disjoint": not found.shared_families,
        "files are disjoint": not found.shared_files,
        "sequences keep to their split": not found.out_of_split,
        "no held-out shape is a copy": not found.copies,
    }
