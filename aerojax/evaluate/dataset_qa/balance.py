"""Composition of a data set: how many of what, and how evenly (thesis Table 6.3)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from aerojax.core.types import CLASSES
from aerojax.data.manifest import SequenceEntry
from aerojax.data.splits import SPLITS


@dataclass(frozen=True)
class Composition:
    """One row of Table 6.3: a rig's part of one split.

    frames_by_class: moments (not images), by class of the object that the sequence is about, in the order of `CLASSES`.
    entropy_ratio: H/Hmax of those frames. gini: Gini-Simpson index of them.
    """

    rig: str
    split: str
    identities: int
    sequences: int
    frames: int
    frames_by_class: tuple[int, ...]
    entropy_ratio: float
    gini: float


def entropy_ratio(counts: Sequence[int]) -> float:
    """Normalised Shannon entropy H/Hmax = -sum(p log p) / log(number of classes); 1 where all counts are equal.

    0 without any count.
    """
    total = sum(counts)
    shares = [count / total for count in counts if count] if total else []
    # Adding zero turns the -0.0 of a single class into 0.0.
    return -sum(p * math.log(p) for p in shares) / math.log(len(counts)) + 0.0


def gini_simpson(counts: Sequence[int]) -> float:
    """Gini-Simpson index 1 - sum(p^2): the chance that two frames drawn at random are of different classes.

    It is what the thesis prints as "Gini coefficient": its counts give its figures. It grows with balance, up to
    1 - 1/classes (0.75 for four), so the thesis' arrow "lower is more balanced" points the wrong way. 0 without counts.
    """
    total = sum(counts)
    return 1.0 - sum((count / total) ** 2 for count in counts) if total else 0.0


def compositions(sequences: Sequence[SequenceEntry]) -> tuple[Composition, ...]:
    """Rows by rig and split, in the order of names and of `SPLITS`; splits without sequences have no row."""
    rows = []
    for rig in sorted({sequence.rig for sequence in sequences}):
        for split in SPLITS:
            mine = [s for s in sequences if s.rig == rig and s.split == split]
            if mine:
                rows.append(_row(rig, split, mine))
    return tuple(rows)


def _row(rig: str, split: str, sequences: Sequence[SequenceEntry]) -> Composition:
    by_class = tuple(sum(s.frames for s in sequences if s.label == label) for label in CLASSES)
    return Composition(
        rig=rig,
        split=split,
        identities=len({s.identity for s in sequences}),
        sequences=len(sequences),
        frames=sum(s.frames for s in sequences),
        frames_by_class=by_class,
        entropy_ratio=entropy_ratio(by_class),
        gini=gini_simpson(by_class),
    )
