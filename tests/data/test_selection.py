"""Which training clips a run reads."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from aerojax.core.errors import UserError
from aerojax.core.types import CLASSES
from aerojax.data.clips import ClipSet
from aerojax.data.selection import SelectionConfig, select_clips

PUBLISHED = {f"{label}_known" for label in CLASSES}


def clip_set() -> ClipSet:
    """Of each class four clips of a published individual and two of each of three mixtures; column 0 is the number."""
    names = [
        name for label in CLASSES for name in (f"{label}_known",) * 4 + tuple(f"{label}_{i // 2}" for i in range(6))
    ]
    label = np.repeat(np.arange(len(CLASSES)), 10)
    columns = np.zeros((len(names), 1, 1, 14), np.float32)
    columns[..., 0] = np.arange(len(names))[:, None, None]
    return ClipSet(columns, np.ones((len(names), 1), bool), label, tuple(names))


def test_all_clips_by_default():
    clips = clip_set()
    assert select_clips(clips, SelectionConfig(), published=PUBLISHED, seed=0) is clips


def test_published_individuals_alone():
    found = select_clips(clip_set(), SelectionConfig(published=True), published=PUBLISHED, seed=0)
    assert set(found.identity) == PUBLISHED and len(found.label) == 16


@pytest.mark.parametrize("seed", [0, 1])
def test_individuals_take_turns(seed):
    found = select_clips(clip_set(), SelectionConfig(per_class=6), published=PUBLISHED, seed=seed)
    assert Counter(found.label.tolist()) == dict.fromkeys(range(len(CLASSES)), 6)
    for label in CLASSES:
        counts = Counter(name for name in found.identity if name.startswith(label))
        assert len(counts) == 4 and max(counts.values()) == 2


def test_other_seeds_choose_other_clips():
    one, same, other = (
        select_clips(clip_set(), SelectionConfig(per_class=3), published=PUBLISHED, seed=seed).columns[:, 0, 0, 0]
        for seed in (0, 0, 1)
    )
    assert one.tolist() == same.tolist() != other.tolist() and sorted(one) == one.tolist()


def test_too_few_clips_are_refused():
    with pytest.raises(UserError, match=f"per_class is 5, and there are 4 clips of class {CLASSES[0]}") as caught:
        select_clips(clip_set(), SelectionConfig(published=True, per_class=5), published=PUBLISHED, seed=0)
    assert caught.value.code == "out-of-range"
