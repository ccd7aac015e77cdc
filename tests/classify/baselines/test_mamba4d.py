"""Mamba4D by laws: the order of its tubes, what drop path leaves, that nothing later is read earlier."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.clip_examples import random_clip
from support.tiny_baselines import MAMBA4D, TIME, TOKENS, tiny_classifier

from aerojax.classify.baselines.config import Mamba4DConfig
from aerojax.classify.baselines.mamba4d import MixerStack, PointEncoder, tube_order
from aerojax.classify.mambasplat.config import MambaSplatConfig
from aerojax.classify.mambasplat.mamba import MambaStack

COORDINATE = np.array([[3.0, 1.0, 2.0], [5.0, 6.0, 4.0]], np.float32)


def test_the_true_order_is_by_rank_and_then_by_frame():
    order = tube_order(jnp.asarray(COORDINATE), True)
    np.testing.assert_array_equal(COORDINATE.reshape(-1)[order], [1, 4, 2, 5, 3, 6])


def test_the_published_order_sorts_indices_as_if_they_were_ranks():
    # Frame 0 sorts to tubes 1, 2, 0 and frame 1 to tubes 2, 0, 1: tube 0 stands at places 2 and 1, and so on.
    np.testing.assert_array_equal(tube_order(jnp.asarray(COORDINATE), False), [2, 4, 0, 5, 1, 3])
    many = np.random.default_rng(0).normal(size=(4, 7)).astype(np.float32)
    published, true = (np.asarray(tube_order(jnp.asarray(many), flag)) for flag in (False, True))
    assert sorted(published) == sorted(true) == list(range(28))
    assert not np.array_equal(published, true)
    places = np.argsort(np.argsort(many, axis=1), axis=1)
    np.testing.assert_array_equal(published, (places + 7 * np.arange(4)[:, None]).T.reshape(-1))


@pytest.mark.long
def test_the_order_is_a_switch():
    clip, mask = random_clip(0, time=TIME, tokens=TOKENS), jnp.ones((TIME, TOKENS), bool)
    classifier = tiny_classifier("mamba4d")
    switched = jax.tree.map(lambda leaf: leaf, classifier)
    switched.network.true_sort = True
    read = jax.jit(lambda classifier: classifier.logits(clip, mask))
    assert np.abs(read(classifier) - read(switched)).max() > 1e-5
    assert "sorted" in Mamba4DConfig(true_sort=True).label


@pytest.mark.long
def test_the_stack_is_the_one_of_mambasplat():
    """Same weights, same numbers; only how it is scanned and dropped differs."""
    ours = MixerStack(16, 3, Mamba4DConfig(), key=jax.random.key(0))
    theirs = MambaStack(MambaSplatConfig(d_model=16, mamba_layers=3), key=jax.random.key(1))
    theirs.layers, theirs.norm = ours.layers, ours.norm
    x = jax.random.normal(jax.random.key(2), (9, 16))
    answer = jax.jit(lambda stack, x: stack(x))
    np.testing.assert_allclose(answer(ours, x), answer(theirs, x), atol=1e-5)
    later = answer(ours, x.at[5:].multiply(2.0))
    np.testing.assert_allclose(later[:5], answer(ours, x)[:5], atol=1e-6)
    assert np.abs(later[5:] - answer(ours, x)[5:]).max() > 1e-3


@pytest.mark.long
def test_without_dropout_a_key_changes_nothing_and_a_dropped_path_takes_the_layer():
    x, key = jax.random.normal(jax.random.key(2), (9, 16)), jax.random.key(5)
    none = MixerStack(16, 3, Mamba4DConfig(dropout=0.0, drop_path=0.0), key=jax.random.key(0))
    np.testing.assert_allclose(jax.jit(lambda s: s(x, key=key))(none), jax.jit(lambda s: s(x))(none), atol=1e-6)
    dropped = MixerStack(16, 2, Mamba4DConfig(dropout=0.0, drop_path=0.999), key=jax.random.key(0))
    first, second = (jax.tree.map(lambda leaf, i=i: leaf[i], dropped.layers) for i in (0, 1))
    np.testing.assert_allclose(
        jax.jit(lambda s: s(x, key=key))(dropped),
        dropped.norm(x + second.mixer(second.norm(x))),  # of the first layer nothing is left
        atol=1e-5,
    )
    assert np.abs(first.mixer(first.norm(x))).max() > 1e-3


def test_points_of_a_ball_have_no_order_and_their_own_coordinates():
    encoder = PointEncoder(MAMBA4D, key=jax.random.key(0))
    balls = jax.random.normal(jax.random.key(1), (1, 2, 6, 3))
    encode = jax.jit(lambda encoder, balls: encoder(balls))
    np.testing.assert_allclose(encode(encoder, balls[:, :, ::-1]), encode(encoder, balls), atol=1e-6)
    assert np.abs(encode(encoder, balls + 1.0) - encode(encoder, balls)).max() > 1e-2
