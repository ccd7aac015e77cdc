"""Which of many training clips a run reads: those of some individuals, and equally many of each class."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from aerojax.core.errors import UserError
from aerojax.data.clips import ClipSet


@dataclass(frozen=True)
class SelectionConfig:
    """Some of the training clips.

    published: of the individuals of the published split alone, without mixtures of their families.
    per_class: so many of each class, drawn by the run's seed; 0 takes all.
    """

    published: bool = False
    per_class: int = 0


def select_clips(clips: ClipSet, config: SelectionConfig, *, published: Collection[str], seed: int) -> ClipSet:
    """The clips that a selection names.

    Where a class has more clips than are wanted its individuals take turns, so that as many of them as can be are
    there, each with equally many clips up to one.

    Args:
        clips: any.
        config: all of them by default.
        published: names of the individuals of the published split.
        seed: of the order in which individuals and their clips come.

    Raises:
        UserError: a class has fewer clips than are wanted.
    """
    index = np.arange(len(clips.label))
    if config.published:
        index = index[[name in published for name in clips.identity]]
    if config.per_class:
        order = np.random.default_rng(seed).permutation(index)
        index = np.sort(
            np.concatenate([_first(clips, order, label, config.per_class) for label in range(len(clips.classes))])
        )
    return clips if len(index) == len(clips.label) else clips.take(index)


def _first(clips: ClipSet, order: np.ndarray, label: int, count: int) -> np.ndarray:
    """The first clips of a class, its individuals in turn."""
    turns: dict[str, int] = {}
    ranked = []
    for place, index in enumerate(order[clips.label[order] == label]):
        turn = turns[clips.identity[index]] = turns.get(clips.identity[index], -1) + 1
        ranked.append((turn, place, index))
    if len(ranked) < count:
        problem = f"selection.per_class is {count}, and there are {len(ranked)} clips of class {clips.classes[label]}"
        raise UserError("out-of-range", problem, "lower it or make more clips with experiments.generate_clips")
    return np.array([index for _, _, index in sorted(ranked)[:count]])
