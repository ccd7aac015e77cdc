"""Entries of data sets' manifests."""

from __future__ import annotations

from pathlib import Path

from aerojax.data.manifest import SequenceEntry


def sequence(name: str, label: str, split: str, frames: int, *others: str) -> SequenceEntry:
    """A sequence of `name`'s object, of which nothing is on disk; `others` fly in it too."""
    identity = f"{label}_{name}"
    objects = (identity, *others)
    return SequenceEntry(Path(name), name, label, identity, split, "sim1", frames, 30.0, objects, 4, 16.0)
