"""Windows, which keys a token may see, positions, and neighbours."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.depthsplat_examples import SMALL

from aerojax.reconstruct.depthsplat.draws import drawn
from aerojax.reconstruct.depthsplat.transformer import (
    OTHER_REGION,
    MultiViewBlock,
    Neighbours,
    merged,
    neighbours_of,
    window_positions,
    window_regions,
    windows,
)


@pytest.mark.parametrize("shifted", [False, True])
def test_windows_and_back(shifted):
    x = jnp.asarray(np.random.default_rng(0).normal(size=(2, 8, 8, 3)), jnp.float32)
    split = windows(x, 2, shifted=shifted)
    assert split.shape == (2, 4, 16, 3)
    np.testing.assert_array_equal(merged(split, 2, shifted=shifted), x)
    first = x[:, 2:6, 2:6] if shifted else x[:, :4, :4]
    np.testing.assert_array_equal(split[:, 0], first.reshape(2, 16, 3))


def test_regions_are_the_image_s_own():
    """Two tokens of a shifted window belong together if they are no further apart in the image than a window."""
    rows, columns = jnp.mgrid[:8, :8].astype(jnp.float32)
    place = np.asarray(windows(jnp.stack([rows, columns], axis=-1)[None], 2, shifted=True)[0])
    apart = np.abs(place[:, :, None] - place[:, None]).max(axis=-1)
    regions = window_regions(8, 2)
    np.testing.assert_array_equal(regions[:, :, None] == regions[:, None], apart < 4)


def test_sine_positions_by_hand():
    table = window_positions(4, 8)
    step = 2 * np.pi / 4  # up to the 1e-6 of its normalisation
    np.testing.assert_allclose(table[1, 2, 0], np.sin(2 * step), atol=1e-5)
    np.testing.assert_allclose(table[1, 2, 1], np.cos(2 * step), atol=1e-5)
    np.testing.assert_allclose(table[1, 2, 2], np.sin(2 * step / 10000**0.5), atol=1e-5)
    np.testing.assert_allclose(table[1, 2, 4], np.sin(3 * step), atol=1e-5)


def test_neighbours_are_the_nearest_that_count():
    centres = jnp.asarray([[0, 0, 0], [1, 0, 0], [3, 0, 0], [7, 0, 0], [2.2, 0, 0]], jnp.float32)
    found = neighbours_of(centres, jnp.asarray([True, True, True, True, False]), 2)
    np.testing.assert_array_equal(found.index[0], [1, 2])
    np.testing.assert_array_equal(found.index[3], [2, 1])
    assert found.counts.all()
    few = neighbours_of(centres, jnp.asarray([True, True, False, False, False]), 3)
    np.testing.assert_array_equal(few.counts[0], [True, False, False])
    np.testing.assert_array_equal(neighbours_of(centres[:3], jnp.ones(3, bool), 5).index, [[1, 2], [0, 2], [0, 1]])


@pytest.fixture(scope="module")
def block():
    made = drawn(lambda draws: MultiViewBlock(SMALL, draws=draws), key=jax.random.key(1))
    rng = np.random.default_rng(2)
    return jax.tree.map(lambda leaf: leaf + jnp.asarray(0.5 * rng.standard_normal(leaf.shape), leaf.dtype), made)


@pytest.fixture(scope="module")
def x():
    return jnp.asarray(np.random.default_rng(4).normal(size=(3, 8, 8, SMALL.width)), jnp.float32)


def explicit(block, x, view, row, column):
    """One token's cross-attention in shifted windows, key by key."""
    after_self = np.asarray(block.attend_self(x, shifted=True), float)
    weight = {n: np.asarray(getattr(block.other, n).weight[...], float) for n in ("query", "key", "value")}
    query = weight["query"] @ after_self[view, row, column]
    window = ((row - 2) % 8 // 4, (column - 2) % 8 // 4)
    scores, values = [], []
    for other in [o for o in range(3) if o != view]:
        for r, c in np.ndindex(8, 8):
            if ((r - 2) % 8 // 4, (c - 2) % 8 // 4) != window:
                continue
            key = np.asarray(x[other, r, c], float)
            near = max(abs(r - row), abs(c - column)) < 4
            scores.append(query @ (weight["key"] @ key) / np.sqrt(SMALL.width) + (0 if near else OTHER_REGION))
            values.append(weight["value"] @ key)
    share = np.exp(np.array(scores) - max(scores))
    return (share / share.sum()) @ np.array(values)


@pytest.mark.parametrize(("compat", "agrees"), [(False, True), (True, False)])
def test_shifted_cross_attention_key_by_key(block, x, compat, agrees):
    """With two neighbours upstream's mask hides the wrong keys."""
    block = jax.tree.map(lambda leaf: leaf, block)
    block.compat = compat
    neighbours = neighbours_of(jnp.eye(3), jnp.ones(3, bool), 5)
    out = block(x, neighbours, shifted=True)
    after_self = block.attend_self(x, shifted=True)
    for view, row, column in [(0, 0, 0), (1, 7, 1), (2, 3, 6)]:
        message = jnp.asarray(explicit(block, x, view, row, column), jnp.float32)
        token = after_self[view, row, column]
        expected = token + block.forward(token, block.other.norm(block.other.merge(message)))
        close = np.allclose(out[view, row, column], expected, atol=2e-4)
        if agrees:
            assert close
        elif not close:
            return
    assert agrees


def test_a_view_without_neighbours_hears_nothing(block, x):
    index = neighbours_of(jnp.eye(3), jnp.ones(3, bool), 5).index
    alone = Neighbours(index, jnp.zeros((3, 2), bool))
    out = block(x, alone, shifted=False)
    changed = block(x.at[1].add(1.0), alone, shifted=False)
    np.testing.assert_array_equal(out[0], changed[0])
    assert np.isfinite(out).all()
    heard = dataclasses.replace(alone, counts=jnp.ones((3, 2), bool))
    before, after = block(x, heard, shifted=False)[0], block(x.at[1].add(1.0), heard, shifted=False)[0]
    assert not np.allclose(before, after)
