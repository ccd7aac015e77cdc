"""Normalised clouds, neighbours, balls and tubes against numbers worked out by hand or written as loops."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.clip_examples import random_clip

from aerojax.classify.baselines.clouds import clouds, cycled, in_ball, nearest
from aerojax.classify.baselines.config import TubeSizes
from aerojax.classify.baselines.tubes import tubes, valid_anchor_frames, with_time

POINTS = jnp.asarray([[0.0, 0, 0], [1, 0, 0], [0.4, 0, 0], [0, 0.3, 0], [5, 5, 5]])


def test_slots_are_filled_in_turn():
    np.testing.assert_array_equal(cycled(jnp.asarray([False, True, False, True, True])), [1, 3, 4, 1, 3])
    np.testing.assert_array_equal(cycled(jnp.zeros(3, bool)), [0, 1, 2])


@pytest.mark.parametrize("normalisation", ["frame", "clip"])
def test_clouds_are_centred_in_the_unit_ball(normalisation):
    columns = random_clip(0, time=3, tokens=8).at[1, :, :3].add(10.0)
    mask = jnp.ones((3, 8), bool).at[0, 5:].set(False).at[2].set(False)
    found = np.asarray(clouds(columns, mask, normalisation))
    position = np.asarray(columns[..., :3])
    first, second = position[0, :5], position[1]
    np.testing.assert_array_equal(found[2], 0)
    np.testing.assert_array_equal(found[0, 5:], found[0, :3])
    if normalisation == "frame":
        centred = first - first.mean(axis=0)
        np.testing.assert_allclose(found[0, :5], centred / np.linalg.norm(centred, axis=1).max(), atol=1e-5)
        assert np.linalg.norm(found[:2], axis=2).max(axis=1) == pytest.approx([1, 1], abs=1e-5)
    else:
        both = np.concatenate([first, second])
        centred = both - both.mean(axis=0)
        expected = centred / np.linalg.norm(centred, axis=1).max()
        np.testing.assert_allclose(np.concatenate([found[0, :5], found[1]]), expected, atol=1e-5)
    np.testing.assert_array_equal(clouds(columns, mask, "none")[1], position[1])


def test_balls_hold_the_first_points_in_order_and_are_filled_by_the_first():
    anchors = jnp.asarray([[0.0, 0, 0], [1, 0, 0], [-9, 0, 0]])
    np.testing.assert_array_equal(in_ball(POINTS, anchors, 0.5, 2), [[0, 2], [1, 1], [0, 0]])
    # The sphere itself is no part of the ball, and more are wanted than there are.
    wide = np.asarray(in_ball(POINTS, anchors, 0.4, 7))
    np.testing.assert_array_equal(wide[0], [0, 3, 0, 0, 0, 0, 0])
    assert wide.shape == (3, 7)


def test_nearest_tokens_are_those_of_sorted_distances():
    x = np.random.default_rng(1).normal(size=(12, 4))
    expected = np.argsort(np.linalg.norm(x[:, None] - x[None], axis=2), axis=1)[:, :5]
    np.testing.assert_array_equal(nearest(jnp.asarray(x, jnp.float32), 5), expected)
    assert nearest(POINTS, 20).shape == (5, 5)


@pytest.mark.parametrize(("frames", "count"), [(6, 6), (7, 7), (6, 3), (1, 1), (6, 1)])
def test_tubes_are_those_of_a_loop_over_padded_frames(frames, count):
    points = random_clip(2, time=frames, tokens=12)[..., :3]
    sizes = TubeSizes(radius=0.8, neighbours=4, stride=4)
    cut = jax.jit(lambda points: tubes(points, jnp.asarray(count), sizes))(points)
    clip = list(np.asarray(points[:count]))
    padded = [clip[0], *clip] if count > 1 else [clip[0]] * 3
    centres = range(1, len(padded) - 1, 2)
    assert np.asarray(valid_anchor_frames(jnp.asarray(count), frames)).sum() == len(centres)
    for index, t in enumerate(centres):
        chosen = [0]
        while len(chosen) < 3:
            gaps = np.min([np.sum((padded[t] - padded[t][c]) ** 2, axis=1) for c in chosen], axis=0)
            chosen.append(int(np.argmax(np.where(np.sum(padded[t] ** 2, axis=1) > 1e-3, gaps, -1))))
        np.testing.assert_array_equal(cut.anchors[index], padded[t][chosen])
        for offset, frame in enumerate(padded[t - 1 : t + 2]):
            for tube, anchor in enumerate(padded[t][chosen]):
                hits = np.flatnonzero(np.sum((frame - anchor) ** 2, axis=1) < 0.8**2)[:4]
                hits = np.concatenate([hits, np.full(4 - len(hits), hits[0] if len(hits) else 0)]).astype(int)
                np.testing.assert_array_equal(cut.points[index, offset, tube], frame[hits])


def test_anchor_frames_are_numbered_from_one():
    np.testing.assert_array_equal(with_time(jnp.zeros((2, 1, 3)))[..., 3], [[1], [2]])
