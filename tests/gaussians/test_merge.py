"""Merging by moments: nothing is lost, it turns with the tokens, and neither their order nor padding is seen."""

from __future__ import annotations

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.clip_examples import random_clip, rotate_columns

from aerojax.gaussians.merge import MergedGaussians, merge_gaussians, merge_moments
from aerojax.geometry.covariances import covariance_from_axes
from aerojax.geometry.rotations import haar_rotation

COUNT = 12
merged = jax.jit(partial(merge_moments, count=COUNT), static_argnames=("lloyd", "seeds"))
BOTH = pytest.mark.parametrize("seeds", ["first", "farthest"])


def cloud(seed=0, tokens=96, dtype=np.float32):
    return random_clip(seed, time=1, tokens=tokens, dtype=dtype)[0]


def moments(mean, covariance, weight):
    """Mean and covariance of a mixture."""
    weight = weight / weight.sum()
    centre = weight @ mean
    return centre, np.einsum("k,kab->ab", weight, covariance + np.einsum("ka,kb->kab", mean - centre, mean - centre))


@BOTH
def test_mixture_keeps_its_moments_and_masses(x64, seeds):
    columns = cloud(dtype=np.float64)
    found = merged(columns, jnp.ones(96, bool), seeds=seeds)
    own = covariance_from_axes(columns[:, 3:7], columns[:, 7:10])
    before = moments(*map(np.asarray, (columns[:, :3], own, columns[:, 10])))
    after = moments(*map(np.asarray, (found.mean, found.covariance, found.share)))
    for ours, theirs in zip(after, before, strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-12)
    weight = columns[:, 10] / columns[:, 10].sum()
    np.testing.assert_allclose(found.share.sum(), 1, atol=1e-12)
    np.testing.assert_allclose(found.share @ found.colour, weight @ columns[:, 11:], atol=1e-12)
    np.testing.assert_allclose(found.share @ found.opacity, weight @ columns[:, 10], atol=1e-12)


def test_two_lumps_become_two_gaussians_known_by_hand():
    columns = cloud(tokens=4).at[:, 7:10].set(0.1).at[:, 10].set(jnp.array([0.2, 0.6, 0.5, 0.5]))
    columns = columns.at[:, :3].set(jnp.array([[0.0, 0, 0], [0.4, 0, 0], [9, 1, 0], [9, 1.2, 0]]))
    columns, mask = jax.jit(partial(merge_gaussians, count=2))(columns, jnp.ones(4, bool))
    columns = columns[jnp.argsort(columns[:, 0])]
    np.testing.assert_allclose(columns[:, :3], [[0.3, 0, 0], [9, 1.1, 0]], atol=1e-5)
    # Means weighted 1:3 spread 0.4²·3/16, and 1:1 spread 0.1², beside the members' own 0.1².
    np.testing.assert_allclose(columns[:, 7], np.sqrt([0.01 + 0.03, 0.02]), rtol=1e-4)
    np.testing.assert_allclose(columns[:, 8:10], 0.1, rtol=1e-3)
    np.testing.assert_allclose(columns[:, 10], [0.5, 0.5], atol=1e-5)
    assert mask.all()


@BOTH
def test_it_turns_and_moves_with_the_tokens(seeds):
    columns, mask = cloud(1), jnp.ones(96, bool)
    here = merged(columns, mask, seeds=seeds)
    for key in jax.random.split(jax.random.key(0), 16):
        rotation = haar_rotation(key=key)
        there = merged(rotate_columns(columns, rotation).at[:, :3].add(2.0), mask, seeds=seeds)
        np.testing.assert_allclose(there.mean, here.mean @ rotation.T + 2.0, atol=1e-5)
        np.testing.assert_allclose(
            there.covariance, jnp.einsum("ab,kbc,dc->kad", rotation, here.covariance, rotation), atol=1e-5
        )
        np.testing.assert_allclose(there.share, here.share, atol=1e-5)
    stretched = merged(columns.at[:, 0].multiply(2.0), mask, seeds=seeds)
    assert jnp.abs(stretched.share - here.share).max() > 1e-3


def test_columns_turn_as_covariances():
    columns, mask = cloud(2), jnp.ones(96, bool)
    merge = jax.jit(partial(merge_gaussians, count=COUNT))
    rotation = haar_rotation(key=jax.random.key(1))
    here, there = merge(columns, mask)[0], merge(rotate_columns(columns, rotation), mask)[0]
    turned = [covariance_from_axes(rows[:, 3:7], rows[:, 7:10]) for rows in (rotate_columns(here, rotation), there)]
    np.testing.assert_allclose(turned[1], turned[0], atol=1e-5)
    np.testing.assert_allclose(there[:, 7:], here[:, 7:], atol=1e-4)


def test_farthest_seeds_do_not_see_the_order_and_first_ones_do():
    columns, mask = cloud(3), jnp.ones(96, bool)
    shuffled = columns[jax.random.permutation(jax.random.key(0), 96)]
    here, there = merged(columns, mask), merged(shuffled, mask)
    for ours, theirs in zip(jax.tree.leaves(here), jax.tree.leaves(there), strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-5)
    first = [merged(rows, mask, seeds="first").mean for rows in (columns, shuffled)]
    assert jnp.abs(first[0] - first[1]).max() > 1e-2


@BOTH
def test_padding_is_not_seen(seeds):
    columns = cloud(4)
    garbage = columns.at[40:].set(1e3 * cloud(5)[40:])
    mask = jnp.arange(96) < 40
    found = merged(garbage, mask, seeds=seeds)
    expected = merge_moments(columns[:40], mask[:40], COUNT, seeds=seeds)
    for ours, theirs in zip(jax.tree.leaves(found), jax.tree.leaves(expected), strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-5)


@BOTH
@pytest.mark.parametrize("real", [0, 1, 7, COUNT])
def test_no_more_tokens_than_clusters_stay_as_they_are(real, seeds):
    columns, mask = cloud(6), jnp.arange(96) < real
    found = merged(columns, mask, seeds=seeds)
    assert all(bool(jnp.isfinite(leaf).all()) for leaf in jax.tree.leaves(found))
    assert found.mask.sum() == real and (found.share[real:] == 0).all()
    ours, theirs = (np.sort(np.asarray(x)) for x in (found.mean[:real, 0], columns[:real, 0]))
    np.testing.assert_allclose(ours, theirs, atol=1e-6)
    volume = lambda scale: np.sort(np.log(np.asarray(scale)).sum(axis=-1))  # noqa: E731
    spread = jnp.linalg.eigvalsh(found.covariance[:real]) if real else jnp.zeros((0, 3))
    np.testing.assert_allclose(volume(jnp.sqrt(spread)), volume(columns[:real, 7:10]), atol=2e-2)


@BOTH
def test_duplicates_share_their_mass(seeds):
    columns = jnp.tile(cloud(7, tokens=4), (24, 1))
    found = merged(columns, jnp.ones(96, bool), seeds=seeds)
    assert all(bool(jnp.isfinite(leaf).all()) for leaf in jax.tree.leaves(found))
    kept = found.mean[found.mask]
    apart = jnp.abs(kept[:, None] - columns[None, :4, :3]).max(axis=-1).min(axis=1)
    assert apart.max() < 1e-5 and found.share.sum() == pytest.approx(1, abs=1e-5)


def test_farthest_seeds_leave_no_part_alone():
    """A thin rod beside a dense ball gets its own Gaussians, whose covariance is thin."""
    rng = np.random.default_rng(0)
    rod = np.stack([np.linspace(1, 5, 16), np.zeros(16), np.zeros(16)], axis=1)
    columns = cloud(8, tokens=216).at[:, 7:10].set(0.01).at[:, 10].set(0.9)
    columns = columns.at[:, :3].set(jnp.asarray(np.concatenate([0.2 * rng.normal(size=(200, 3)), rod]), jnp.float32))
    found = merged(columns, jnp.ones(216, bool))
    on_rod = np.asarray(found.mean[:, 0] > 1.0)
    assert on_rod.sum() >= 4
    values = np.linalg.eigvalsh(np.asarray(found.covariance)[on_rod])
    assert (values[:, 2] > 10 * values[:, 1]).sum() >= 3


def test_frames_side_by_side_are_frames_alone():
    clip, mask = random_clip(9, time=3, tokens=96), jnp.ones((3, 96), bool)
    together = jax.jit(jax.vmap(partial(merge_moments, count=COUNT)))(clip, mask)
    assert isinstance(together, MergedGaussians)
    for t in range(3):
        for ours, theirs in zip(jax.tree.leaves(together), jax.tree.leaves(merged(clip[t], mask[t])), strict=True):
            np.testing.assert_allclose(ours[t], theirs, atol=1e-5)


def test_means_are_counted_from_an_origin():
    columns, mask = cloud(6), jnp.ones(96, bool)
    origin = jnp.array([[0.5, -2.0, 1.0], [1e-3, 0.0, 0.0]], columns.dtype)
    plain, moved = merged(columns, mask), merged(columns, mask, origin=origin)
    np.testing.assert_allclose(moved.mean, plain.mean - origin.sum(axis=0, keepdims=True), atol=1e-6)
    np.testing.assert_array_equal(moved.covariance, plain.covariance)
