"""Decimation: sizes, seeds, fairness of repeats, and the same choice in a turned world."""

from __future__ import annotations

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.splat_scenes import QUICK

from aerojax.core.types import Gaussians
from aerojax.gaussians.decimate import DecimationConfig, decimate
from aerojax.gaussians.rotate import rotate
from aerojax.geometry.rotations import haar_rotation

CONFIG = DecimationConfig(draw=400, farthest=120, keep=64)


def cloud(count, seed=0):
    rng = np.random.default_rng(seed)
    columns = rng.normal(size=(count, 14)).astype(np.float32)
    columns[:, 3:7] /= np.linalg.norm(columns[:, 3:7], axis=1, keepdims=True)
    columns[:, 7:10] = np.exp(columns[:, 7:10])
    columns[:, 10] = np.arange(count)  # every Gaussian can be recognised by its opacity
    return Gaussians.from_columns(jnp.asarray(columns))


@partial(jax.jit, static_argnames="config", compiler_options=QUICK)
def chosen(gaussians, key, count=None, config=CONFIG):
    return decimate(gaussians, key=key, config=config, count=count).opacity


@pytest.mark.parametrize("size", [1, 64, 120, 121, 1000])
def test_size_is_always_the_same(size):
    kept = jax.jit(partial(decimate, config=CONFIG), compiler_options=QUICK)(cloud(size), key=jax.random.key(0))
    assert kept.mean.shape == (64, 3) and kept.sh.shape == (64, 1, 3)
    source = cloud(size)
    index = np.asarray(kept.opacity).astype(int)
    for ours, theirs in zip(jax.tree.leaves(kept), jax.tree.leaves(source), strict=True):
        np.testing.assert_array_equal(ours, theirs[index])  # attributes stay together


def test_the_key_decides():
    source = cloud(1000)
    first, again = chosen(source, jax.random.key(1)), chosen(source, jax.random.key(1))
    np.testing.assert_array_equal(first, again)
    assert len(np.intersect1d(first, chosen(source, jax.random.key(2)))) < 64


def test_none_is_drawn_twice_where_there_are_enough():
    for size in (120, 250, 400):
        assert len(np.unique(chosen(cloud(size), jax.random.key(3)))) == 64


def test_farthest_points_spread():
    """Of a dense and a sparse cluster, the sparse one is kept nearly whole, unlike by a random draw."""
    rng = np.random.default_rng(0)
    points = np.concatenate([0.05 * rng.normal(size=(360, 3)), rng.normal(size=(40, 3))]).astype(np.float32)
    source = cloud(400)
    source = Gaussians(jnp.asarray(points), source.quaternion, source.scale, source.opacity, source.sh)
    config = DecimationConfig(draw=400, farthest=60, keep=60)
    kept = np.asarray(chosen(source, jax.random.key(0), config=config))
    assert (kept >= 360).sum() >= 38


@pytest.mark.parametrize("real", [1, 7, 40, 64])
def test_few_gaussians_are_each_taken_and_repeats_balanced(real):
    config = DecimationConfig(draw=400, farthest=120, keep=120)
    padded = jax.tree.map(lambda leaf: jnp.concatenate([leaf[:real], jnp.repeat(leaf[:1], 300, axis=0)]), cloud(real))
    kept = np.asarray(chosen(padded, jax.random.key(5), real, config)).astype(int)
    counts = np.bincount(kept, minlength=real)
    assert len(counts) == real and counts.min() >= 1 and counts.sum() == 120
    # One sure place each, the rest at random: no count beyond six standard deviations of a fair draw.
    spare = 120 - real
    assert counts.max() <= 1 + spare / real + 6 * np.sqrt(spare / real * (1 - 1 / real)) + 1e-9


def test_padding_is_never_drawn_as_something_else():
    junk = jax.tree.map(lambda leaf: jnp.concatenate([leaf[:200], jnp.repeat(leaf[:1], 800, axis=0)]), cloud(200))
    kept = np.asarray(chosen(junk, jax.random.key(0), 200))
    assert kept.max() < 200 and len(np.unique(kept)) == pytest.approx(64, abs=15)


def test_a_turned_world_gives_the_same_choice():
    source, key = cloud(1000), jax.random.key(0)
    here = np.asarray(chosen(source, key))
    for seed in range(3):
        turned = rotate(source, haar_rotation(key=jax.random.key(seed)))
        np.testing.assert_array_equal(chosen(turned, key), here)
    stretched = Gaussians(source.mean * jnp.array([[1.0, 1.0, 4.0]]), *jax.tree.leaves(source)[1:])
    assert (np.asarray(chosen(stretched, key)) != here).any()  # a map that changes distances does change the choice
