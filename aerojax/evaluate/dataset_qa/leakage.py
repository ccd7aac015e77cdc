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

COPY = 3.0
"""Shapes closer than so many times what a second sampling of one shape is away from the first are taken as one."""


@dataclass(frozen=True, eq=False)
class Embedded:
    """An identity's shape embedding, and how far another sampling of the same surface lies from it."""

    entry: IdentityEntry
    embedding: Float[np.ndarray, "feature"]
    noise: float


@dataclass(frozen=True)
class Neighbour:
    """The training identity of the same class that is nearest to an identity, and its distance."""

    identity: str
    nearest: str
    distance: float


@dataclass(frozen=True)
class ClassDistances:
    """Nearest-neighbour distances of one class.

    train_to_train: smallest and median, between different families; NaN where training has fewer than two families.
    test_to_train: smallest and median of the held-out identities. noise: largest of a second sampling.
    """

    label: str
    train_to_train: tuple[float, float]
    test_to_train: tuple[float, float]
    noise: float


@dataclass(frozen=True)
class Leakage:
    """What crosses the border between splits.

    shared_names, shared_families: found in more than one split. shared_files: groups of assets with equal bytes.
    out_of_split: sequences that show an object of another split.
    copies: held-out shapes that are, within sampling, those of a training identity.
    near: held-out shapes closer to training than any two families of training are to each other.
    """

    identities: int
    shared_names: tuple[str, ...]
    shared_families: tuple[str, ...]
    shared_files: tuple[tuple[str, ...], ...]
    out_of_split: tuple[str, ...]
    copies: tuple[Neighbour, ...]
    near: tuple[Neighbour, ...]
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
    by_class, neighbours, near = [], [], []
    for label in dict.fromkeys(item.entry.label for item in shapes):
        known = [item for item in train if item.entry.label == label]
        found = [_nearest(item, known) for item in held_out if item.entry.label == label and known]
        inner = [_nearest(item, others) for item in known if (others := _other_families(item, known))]
        row = _distances(label, inner, found, max(i.noise for i in shapes if i.entry.label == label))
        by_class.append(row)
        neighbours += found
        near += [n for n in found if n.distance < row.train_to_train[0]]
    noise = {item.entry.name: item.noise for item in shapes}
    return Leakage(
        identities=len(split_of),
        shared_names=_in_several_splits([(i.name, i.split) for i in everyone]),
        shared_families=_in_several_splits([(f"{i.label} {i.family}", i.split) for i in everyone]),
        shared_files=_shared_files(everyone),
        out_of_split=tuple(
            s.name for s in entries.sequences if any(split_of.get(name, s.split) != s.split for name in s.objects)
        ),
        copies=tuple(n for n in neighbours if n.distance < COPY * max(noise[n.identity], noise[n.nearest])),
        near=tuple(near),
        by_class=tuple(by_class),
        neighbours=tuple(sorted(neighbours, key=lambda n: n.distance)),
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
    distances = [float(np.linalg.norm(item.embedding - other.embedding)) for other in others]
    index = int(np.argmin(distances))
    return Neighbour(item.entry.name, others[index].entry.name, distances[index])


def _distances(label: str, inner: Sequence[Neighbour], outer: Sequence[Neighbour], noise: float) -> ClassDistances:
    ends = [
        (float(min(d)), float(np.median(d))) if (d := [n.distance for n in part]) else (np.nan, np.nan)
        for part in (inner, outer)
    ]
    return ClassDistances(label, ends[0], ends[1], noise)


def verdict(found: Leakage) -> Mapping[str, bool]:
    """Whether each check passes."""
    return {
        "names are disjoint": not found.shared_names,
        "families are disjoint": not found.shared_families,
        "files are disjoint": not found.shared_files,
        "sequences keep to their split": not found.out_of_split,
        "no held-out shape is a copy": not found.copies,
    }
