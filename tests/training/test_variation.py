"""Batches and variation of training clips: fair shuffles, draws apart from each other; wrong values are named."""

from __future__ import annotations

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.clip_examples import random_clip
from support.splat_scenes import QUICK

from aerojax.core.errors import UserError
from aerojax.core.types import Gaussians
from aerojax.gaussians.rotate import covariance, rotate
from aerojax.geometry.rotations import haar_rotation
from aerojax.training.variation import VariationConfig, epoch_order, vary_clip

PLAIN = {"frames": 3, "tokens": 12}
KEYS = jax.random.split(jax.random.key(7), 64)


def vary(**changes):
    """The same clip under 64 keys."""
    clip, config = random_clip(0, time=4, tokens=16), VariationConfig(**PLAIN, **changes)
    return jax.jit(jax.vmap(lambda key: vary_clip(clip, jnp.ones(4, bool), config, key=key)), compiler_options=QUICK)(
        KEYS
    )


@partial(jax.jit, static_argnames="config", compiler_options=QUICK)
def vary_one(clip, present, config, key):
    """One clip; tests with one configuration share a program."""
    return vary_clip(clip, present, config, key=key)


def fitted_rotation(source, target):
    """The linear map that takes the positions of one clip to those of another, by least squares."""
    return np.linalg.lstsq(source.reshape(-1, 3), target.reshape(-1, 3), rcond=None)[0].T


@pytest.fixture(scope="module")
def unturned():
    return vary()


@pytest.mark.parametrize("rotation", ["z", "so3"])
def test_a_turned_clip_is_the_unturned_one_under_one_rotation(unturned, rotation):
    (clips, seen), (turned, seen_too) = unturned, vary(rotation=rotation)
    np.testing.assert_array_equal(seen, seen_too)
    np.testing.assert_array_equal(clips[..., 7:], turned[..., 7:])  # jitter, colour and tokens are the same draws
    turns = np.stack([fitted_rotation(*pair) for pair in zip(clips[..., :3], turned[..., :3], strict=True)])
    np.testing.assert_allclose(turns @ turns.transpose(0, 2, 1), np.tile(np.eye(3), (64, 1, 1)), atol=1e-4)
    np.testing.assert_allclose(np.linalg.det(turns), 1.0, atol=1e-4)
    before, after = (covariance(Gaussians.from_columns(columns)) for columns in (clips, turned))
    expected = np.einsum("kij,k...jl,kml->k...im", turns, before, turns)
    np.testing.assert_allclose(after, expected, atol=1e-4)
    up = turns[:, 2, 2]
    if rotation == "z":
        np.testing.assert_allclose(up, 1.0, atol=1e-4)
        assert len(set(np.round(turns[:, 0, 0], 3))) > 50
    else:  # the third coordinate of a uniform point on the sphere is uniform
        assert abs(up.mean()) < 0.25 and 0.45 < up.std() < 0.7


def test_a_scaled_clip_is_a_similarity(unturned):
    clips, scaled = unturned[0], vary(scale=0.4)[0]
    factor = np.asarray(scaled[..., 7] / clips[..., 7])
    np.testing.assert_allclose(factor, factor[:, :1, :1] * np.ones_like(factor), rtol=1e-5)
    each = factor[:, :1, :1, None]
    np.testing.assert_allclose(scaled[..., :3], each * clips[..., :3], rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(scaled[..., 7:10], each * clips[..., 7:10], rtol=1e-5)
    np.testing.assert_array_equal(scaled[..., 3:7], clips[..., 3:7])
    np.testing.assert_array_equal(scaled[..., 10:], clips[..., 10:])
    size = np.log(each.ravel())
    assert -0.4 <= size.min() < -0.25 and 0.25 < size.max() <= 0.4


def test_stretched_axes_have_their_own_factors(unturned):
    clips, stretched = unturned[0], vary(axis_scale=0.1)[0]
    factors = np.asarray(stretched[:, 0, 0, 7:10] / clips[:, 0, 0, 7:10])
    assert factors.min() >= 0.9 and factors.max() <= 1.1 and np.ptp(factors, axis=1).min() > 1e-4
    each = factors[:, None, None, :]
    np.testing.assert_allclose(stretched[..., :3], each * clips[..., :3], rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(stretched[..., 7:10], each * clips[..., 7:10], rtol=1e-5)


def test_a_moved_clip_keeps_all_but_its_place(unturned):
    clips, moved = unturned[0], vary(shift=0.2)[0]
    where = np.asarray(moved[..., :3] - clips[..., :3])
    np.testing.assert_allclose(where, where[:, :1, :1] * np.ones_like(where), atol=1e-5)
    np.testing.assert_array_equal(moved[..., 3:], clips[..., 3:])
    assert where.min() >= -0.2001 and where.max() <= 0.2001 and np.ptp(where[:, 0, 0], axis=0).min() > 0.3


def test_another_key_is_another_clip(unturned):
    assert len(np.unique(np.asarray(unturned[0]).reshape(64, -1), axis=0)) == 64


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("frames", 0),
        ("tokens", 0),
        ("stride", 0),
        ("jitter", -0.1),
        ("colour", -1.0),
        ("scale", -0.1),
        ("shift", -0.1),
        ("drop", 1.0),
        ("axis_scale", 1.0),
        ("axis_scale", -0.1),
    ],
)
def test_values_that_cannot_be_drawn_are_named(name, value):
    with pytest.raises(UserError, match=rf"variation\.{name} is {value}"):
        VariationConfig(**{name: value})


def test_epochs_are_shuffled_the_same_way_each_time():
    first = list(epoch_order(11, 4, seed=0, epoch=5))
    assert [len(b) for b in first] == [4, 4] and len(set(np.concatenate(first))) == 8
    assert all(np.array_equal(a, b) for a, b in zip(first, epoch_order(11, 4, seed=0, epoch=5), strict=True))
    for changes in ({"seed": 1, "epoch": 5}, {"seed": 0, "epoch": 6}):
        assert not np.array_equal(np.concatenate(first), np.concatenate(list(epoch_order(11, 4, **changes))))
    assert list(epoch_order(3, 4, seed=0, epoch=0)) == []
    left_out = {
        i for e in range(8) for i in set(range(11)) - set(np.concatenate(list(epoch_order(11, 4, seed=0, epoch=e))))
    }
    assert len(left_out) > 3  # not always the same tail


def a_clip(time=6, tokens=20, seed=0):
    rng = np.random.default_rng(seed)
    columns = rng.normal(size=(time, tokens, 14)).astype(np.float32)
    columns[..., 3:7] /= np.linalg.norm(columns[..., 3:7], axis=-1, keepdims=True)
    columns[..., 7:10] = np.exp(0.3 * columns[..., 7:10])
    return jnp.asarray(columns)


EVERY = jnp.ones(6, bool)


def test_variation_commutes_with_rotation():
    """Jitter is isotropic noise in the world's axes, so it is off where equality is asked for."""
    config = VariationConfig(frames=4, tokens=12, jitter=0.0)
    turn, key, clip = haar_rotation(key=jax.random.key(8)), jax.random.key(1), a_clip()
    turned_first, seen_first = vary_one(rotate(Gaussians.from_columns(clip), turn).columns(), EVERY, config, key)
    varied, seen = vary_one(clip, EVERY, config, key)
    turned_after = rotate(Gaussians.from_columns(varied), turn)
    np.testing.assert_array_equal(seen, seen_first)
    np.testing.assert_allclose(turned_first[..., :3], turned_after.mean, atol=1e-5)
    ours = covariance(Gaussians.from_columns(turned_first))
    np.testing.assert_allclose(ours, covariance(turned_after), atol=1e-5)
    np.testing.assert_allclose(turned_first[..., 10:], varied[..., 10:], atol=1e-6)


def test_jitter_is_isotropic_and_follows_the_size():
    config = VariationConfig(frames=6, tokens=200, jitter=0.1, colour=0.0, drop=0.0)
    clip = a_clip(tokens=200)
    clip = clip.at[..., 10].set(jnp.arange(200.0))
    offsets = []
    for scale in (1.0, 10.0):
        large = clip.at[..., :3].multiply(scale)
        varied, _ = vary_one(large, EVERY, config, jax.random.key(0))
        source = np.asarray(varied[..., 10]).astype(int)
        time = np.arange(6)[:, None]
        offsets.append(np.asarray(varied[..., :3]) - np.asarray(large)[time, source, :3])
    spread = offsets[0].reshape(-1, 3).std(axis=0)
    np.testing.assert_allclose(spread, 0.1 * np.sqrt(3), rtol=0.12)  # radius of a unit normal cloud is √3
    np.testing.assert_allclose(offsets[1], 10 * offsets[0], atol=1e-4)


def test_windows_stay_inside_a_short_clip():
    config, present = VariationConfig(frames=4, tokens=8), jnp.arange(6) < 3
    for seed in range(5):
        columns, seen = vary_one(a_clip(), present, config, jax.random.key(seed))
        assert columns.shape == (4, 8, 14) and seen.shape == (4, 8)
        np.testing.assert_array_equal(np.asarray(seen).any(axis=1), [True, True, True, False])
        assert np.asarray(seen)[0].sum() >= 8 * (1 - config.drop) - 1


def test_nothing_varied_is_a_choice_of_tokens():
    config = VariationConfig(frames=6, tokens=20, jitter=0.0, colour=0.0, drop=0.0)
    columns, seen = vary_one(a_clip(), EVERY, config, jax.random.key(0))
    assert seen.all()
    for ours, theirs in zip(np.asarray(columns), np.asarray(a_clip()), strict=True):
        np.testing.assert_allclose(ours[np.argsort(ours[:, 0])], theirs[np.argsort(theirs[:, 0])], atol=1e-6)
