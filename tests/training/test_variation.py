"""Variation of training clips: rotations and sizes, each draw apart from the others; wrong values are named."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.clip_examples import random_clip

from aerojax.core.errors import UserError
from aerojax.core.types import Gaussians
from aerojax.gaussians.rotate import covariance
from aerojax.training.variation import VariationConfig, vary_clip

PLAIN = {"frames": 3, "tokens": 12}
KEYS = jax.random.split(jax.random.key(7), 64)


def vary(**changes):
    """The same clip under 64 keys."""
    clip, config = random_clip(0, time=4, tokens=16), VariationConfig(**PLAIN, **changes)
    return jax.jit(jax.vmap(lambda key: vary_clip(clip, jnp.ones(4, bool), config, key=key)))(KEYS)


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
        ("drop", 1.0),
        ("axis_scale", 1.0),
        ("axis_scale", -0.1),
    ],
)
def test_values_that_cannot_be_drawn_are_named(name, value):
    with pytest.raises(UserError, match=rf"variation\.{name} is {value}"):
        VariationConfig(**{name: value})
