"""Operators, layers over time, and configurations of the network."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.clip_examples import logits_of, random_clip

from aerojax.classify.mambasplat.config import MambaSplatConfig, published_config
from aerojax.classify.mambasplat.cost import published_operations
from aerojax.classify.mambasplat.mamba import MambaStack, sinusoids
from aerojax.classify.mambasplat.model import MambaSplat
from aerojax.classify.mambasplat.vector_neurons import (
    VNLinear,
    VNRectifier,
    clip_to_half_space,
    divide_by_rms,
    mix_channels,
    normalise_lengths,
)
from aerojax.core.config import to_dataclass
from aerojax.core.errors import UserError

SMALL = MambaSplatConfig(depth=1, mamba_layers=2, d_model=32, token_features=8, scale_normalisation="frame")


def _plain_clip(q, k, slope):
    inner = jnp.sum(q * k, axis=-2, keepdims=True)
    return q - (1 - slope) * jnp.minimum(inner, 0.0) * k / jnp.sum(k * k, axis=-2, keepdims=True)


@pytest.mark.parametrize("slope", [0.0, 0.2])
def test_rectifier_projects_and_its_gradient_is_that_of_the_formula(x64, slope):
    q, k, g = jax.random.normal(jax.random.key(0), (3, 5, 4, 6), jnp.float64)
    y, pull = jax.vjp(lambda q, k: clip_to_half_space(q, k, slope), q, k)
    expected, expected_pull = jax.vjp(lambda q, k: _plain_clip(q, k, slope), q, k)
    np.testing.assert_allclose(y, expected, atol=1e-13)
    for ours, theirs in zip(pull(g), expected_pull(g), strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-12)
    inner, before = jnp.sum(y * k, axis=-2), jnp.sum(q * k, axis=-2)
    np.testing.assert_allclose(inner, jnp.where(before < 0, slope * before, before), atol=1e-12)


def test_norm_has_the_gradient_of_its_formula(x64):
    x, g = jax.random.normal(jax.random.key(0), (2, 5, 4, 6), jnp.float64)
    x, gain = x.at[0].set(0.0), jnp.linspace(0.5, 2.0, 6)
    ours, pull = jax.vjp(divide_by_rms, x, gain)
    expected, expected_pull = jax.vjp(
        lambda x, gain: x * gain[None, None] / jnp.sqrt(jnp.sum(x * x, axis=(-2, -1), keepdims=True) / 6 + 1e-6),
        x,
        gain,
    )
    np.testing.assert_allclose(ours, expected, atol=1e-13)
    for a, b in zip(pull(g), expected_pull(g), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12)


def _plain_normalised_lengths(x, gain):
    square = jnp.sum(x * x, axis=-2, keepdims=True)
    length = jnp.where(square > 0, jnp.sqrt(jnp.where(square > 0, square, 1.0)), 0.0)
    normalised = (length - length.mean(axis=-1, keepdims=True)) / jnp.sqrt(length.var(axis=-1, keepdims=True) + 1e-5)
    return x / jnp.maximum(length, 1e-6) * normalised * gain[None, None]


def test_published_norm_has_the_gradient_of_its_formula_also_at_zero_and_at_tiny_vectors(x64):
    x, g = jax.random.normal(jax.random.key(0), (2, 5, 4, 6), jnp.float64)
    x, gain = x.at[0].set(0.0).at[1, :, 2].set(0.0).at[2, :, 3].multiply(1e-8), jnp.linspace(0.5, 2.0, 6)
    ours, pull = jax.vjp(normalise_lengths, x, gain)
    expected, expected_pull = jax.vjp(_plain_normalised_lengths, x, gain)
    np.testing.assert_allclose(ours, expected, atol=1e-13)
    for a, b in zip(pull(g), expected_pull(g), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-10, atol=1e-12)


def test_rectifier_behind_a_linear_map_is_that_of_its_output(x64):
    keys = jax.random.split(jax.random.key(0), 3)
    linear, rectify = VNLinear(3, 8, key=keys[0], bias_epsilon=0.3), VNRectifier(8, 8, key=keys[1])
    linear, rectify = jax.tree.map(lambda leaf: leaf.astype(jnp.float64), (linear, rectify))
    x = jax.random.normal(keys[2], (5, 4, 3), jnp.float64)
    ours, pull = jax.vjp(lambda linear, x: rectify.behind(linear, x), linear, x)
    expected, expected_pull = jax.vjp(lambda linear, x: rectify(linear(x)), linear, x)
    np.testing.assert_allclose(ours, expected, atol=1e-13)
    for a, b in zip(jax.tree.leaves(pull(ours)), jax.tree.leaves(expected_pull(ours)), strict=True):
        np.testing.assert_allclose(a, b, atol=1e-12)


@pytest.mark.parametrize(("inputs", "outputs"), [(3, 7), (7, 3)])
def test_mixing_has_the_gradient_of_a_matrix_product(inputs, outputs):
    x, w = jax.random.normal(jax.random.key(0), (2, 5, inputs)), jax.random.normal(jax.random.key(1), (outputs, inputs))
    ours = jax.grad(lambda x, w: jnp.sum(jnp.sin(mix_channels(x, w))), argnums=(0, 1))(x, w)
    expected = jax.grad(lambda x, w: jnp.sum(jnp.sin(x @ w.T)), argnums=(0, 1))(x, w)
    for a, b in zip(ours, expected, strict=True):
        np.testing.assert_allclose(a, b, rtol=2e-5, atol=2e-5)


def test_stack_streams_what_it_scans_and_is_causal():
    stack = MambaStack(SMALL, key=jax.random.key(0))
    hidden = jax.random.normal(jax.random.key(1), (7, 32))
    scan, step = jax.jit(lambda hidden: stack(hidden)), jax.jit(stack.step)
    whole, state = scan(hidden), stack.initial_state()
    for t, frame in enumerate(hidden):
        row, state = step(frame, state)
        np.testing.assert_allclose(row, whole[t], atol=2e-6)
    np.testing.assert_allclose(scan(hidden.at[5:].add(1.0))[:5], whole[:5], atol=1e-6)


def test_dropout_needs_a_key_and_leaves_evaluation_alone():
    model = MambaSplat(dataclasses.replace(SMALL, dropout=0.5), key=jax.random.key(0))
    clip, mask = random_clip(1, time=3, tokens=8), jnp.ones((3, 8), bool)
    train = jax.jit(lambda model, key: model(clip, mask, key=key))
    first, second = (train(model, jax.random.key(k)) for k in (1, 2))
    assert jnp.abs(first - second).max() > 1e-3
    np.testing.assert_array_equal(first, train(model, jax.random.key(1)))
    still = MambaSplat(dataclasses.replace(SMALL, dropout=0.0, drop_path=0.0, head_dropout=0.0), key=jax.random.key(0))
    evaluated = logits_of(still, clip[None], mask)[0]
    np.testing.assert_allclose(train(still, jax.random.key(1)), evaluated, atol=1e-6)


def test_positions_are_interleaved_sines_and_cosines():
    table = sinusoids(4, 6)
    angle = 3 / 10000 ** (2 / 6)
    np.testing.assert_allclose(table[3, 2:4], [np.sin(angle), np.cos(angle)], atol=1e-6)
    np.testing.assert_array_equal(table[0], [0, 1, 0, 1, 0, 1])


def test_configurations_that_contradict_themselves_are_refused():
    with pytest.raises(UserError, match="lifting is 'covariance'"):
        published_config(lifting="covariance")
    with pytest.raises(UserError, match="dropout is 1"):
        MambaSplatConfig(dropout=1.0)
    with pytest.raises(UserError, match="depth is 0"):
        MambaSplatConfig(depth=0)
    with pytest.raises(UserError, match="d_model is 33"):
        MambaSplatConfig(d_model=33)
    with pytest.raises(UserError, match="merged_tokens is -1"):
        MambaSplatConfig(merged_tokens=-1)
    with pytest.raises(UserError, match="no axes"):
        MambaSplatConfig(merged_tokens=64, lifting="columns")
    assert to_dataclass({"mode": "C_O", "depth": 2}, MambaSplatConfig) == MambaSplatConfig(mode="C_O", depth=2)


@pytest.mark.parametrize(
    ("mode", "frames", "tokens", "billions", "digits"),
    [
        ("X", 24, 1024, 103.544, 3),
        ("C", 24, 1024, 44.4205, 4),
        ("X", 16, 512, 19.51, 2),
        ("C", 16, 512, 8.39, 2),
        ("X", 4, 1024, 17.26, 2),
        ("X", 12, 1024, 51.77, 2),
        ("C_O", 24, 1024, 59.20, 2),
        ("C_SH", 24, 1024, 88.76, 2),
        ("C_S_R", 24, 1024, 44.43, 2),
    ],
)
def test_operations_are_those_of_the_thesis(mode, frames, tokens, billions, digits):
    assert round(published_operations(published_config(mode), frames, tokens) / 1e9, digits) == billions
