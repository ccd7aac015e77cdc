"""Answers to clips and windows: batches, orders, rotations and votes, with a classifier whose answers are known."""

from __future__ import annotations

import numpy as np
import pytest
from support.clip_examples import random_clip
from support.known_answers import Heights

from aerojax.classify.base import untrained_card
from aerojax.classify.mambasplat.config import MambaSplatConfig
from aerojax.data.clips import ClipSet, save_clip
from aerojax.data.windows import Windows
from aerojax.evaluate.answers import (
    BATCH,
    LOWEST,
    log_probabilities,
    prefix_log_probabilities,
    shuffled_orders,
    split_figures,
    vote,
)
from aerojax.evaluate.rotations import draw_rotations

HEIGHTS = Heights(untrained_card(MambaSplatConfig(), tokens=8, frames=4))


@pytest.fixture
def windows() -> Windows:
    """Three windows of two videos, the last frame of the second one absent."""
    columns = np.stack([np.asarray(random_clip(seed, time=4, tokens=8)) for seed in range(3)])
    present = np.ones((3, 4), bool)
    present[1, 3] = False
    names = ("a@0", "a@2", "b@0")
    return Windows(columns, present, np.array([0, 0, 1]), np.array([0, 0, 1]), names, ("a", "a", "b"))


def expected(columns):
    """Known logits of frames (…, token, 14)."""
    mean = columns[..., :3].mean(axis=-2)
    z = mean - np.log(np.exp(mean).sum(axis=-1, keepdims=True))
    return np.concatenate([z, np.full((*z.shape[:-1], 1), LOWEST)], axis=-1)


def test_whole_clips_are_answered_in_order_whatever_their_number():
    count = BATCH + 3
    columns = np.stack([np.asarray(random_clip(seed, time=2, tokens=8)) for seed in range(count)])
    clips = ClipSet(columns, np.ones((count, 2), bool), np.zeros(count, int), tuple(map(str, range(count))))
    np.testing.assert_allclose(log_probabilities(HEIGHTS, clips), expected(columns[:, -1]), atol=1e-5)


def test_prefixes_are_turned_ordered_and_never_below_the_floor(windows):
    still = np.stack([draw_rotations(n, "none", frames=4, seed=0, trial=0) for n in windows.name])
    rows = prefix_log_probabilities(HEIGHTS, windows, still)
    np.testing.assert_allclose(rows[0], expected(windows.columns[0]), atol=1e-5)
    np.testing.assert_array_equal(rows[1, 3], rows[1, 2])
    assert rows.min() == pytest.approx(LOWEST)
    half = np.tile([0.0, 1.0, 0.0, 0.0], (3, 4, 1))  # half a turn about x
    turned = windows.columns * np.concatenate([[1, -1, -1], np.ones(11)])
    np.testing.assert_allclose(prefix_log_probabilities(HEIGHTS, windows, half)[0], expected(turned[0]), atol=1e-5)
    order = np.tile([3, 1, 0, 2], (3, 1))
    np.testing.assert_allclose(
        prefix_log_probabilities(HEIGHTS, windows, still, order=order)[2],
        expected(windows.columns[2][order[2]]),
        atol=1e-5,
    )


def test_shuffling_keeps_absent_frames_last(windows):
    order = shuffled_orders(windows, seed=0)
    assert order[1, 3] == 3 and sorted(order[0]) == [0, 1, 2, 3]
    assert not np.array_equal(order, np.tile(np.arange(4), (3, 1)))


def test_a_video_is_the_mean_of_its_windows(windows):
    p = np.array([[0.7, 0.1, 0.1, 0.1], [0.1, 0.7, 0.1, 0.1], [0.25] * 4])
    np.testing.assert_allclose(np.exp(vote(np.log(p), windows)), [p[:2].mean(axis=0), p[2]], atol=1e-6)


def test_figures_of_splits_are_by_folder_and_of_all(tmp_path):
    for rig, count in (("a", 2), ("b", 1), ("c", 1)):
        for index in range(count):
            clip = np.asarray(random_clip(index, time=2, tokens=8))
            save_clip(tmp_path / rig / "test" / f"{index}.npz", clip, "bird", f"{rig}{index}")
    folders = (tmp_path / "a", tmp_path / "b")
    found = split_figures(HEIGHTS, folders, (tmp_path / "c",), split="test", frames=2)
    assert {name: f["clips"] for name, f in found.items()} == {"a": 2, "b": 1, "c": 1, "all": 3}
    assert found["all"]["identities"] == 3
