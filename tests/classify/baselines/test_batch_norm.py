"""Batch norms against their definition, and running statistics that follow by the gradient they are given."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import optax

from aerojax.classify.base import CLIP_AXIS
from aerojax.classify.baselines.batch_norm import BatchNorm
from aerojax.core.tensors import parameter_count
from aerojax.training.optimisers import OptimiserConfig, optimiser_of, without_statistics

WIDTH = 3
X = np.random.default_rng(0).normal([1.0, -2.0, 0.5], [2.0, 0.3, 1.0], (4, 5, 7, WIDTH)).astype(np.float32)
COUNTS = np.ones((4, 5), np.float32)
COUNTS[1, 3:] = 0  # rows that are not there
ROWS = X[COUNTS > 0].reshape(-1, WIDTH)


@jax.jit
def apply(norm, x, counts):
    return jax.vmap(norm, axis_name=CLIP_AXIS)(x, counts)


def test_training_takes_the_statistics_of_the_batch_and_answers_the_running_ones():
    norm = BatchNorm(WIDTH)
    expected = (X - ROWS.mean(axis=0)) / np.sqrt(ROWS.var(axis=0) + 1e-5)
    np.testing.assert_allclose(apply(norm, X, COUNTS), expected, atol=1e-4)
    norm.running_mean[...], norm.running_variance[...] = jnp.full(WIDTH, 2.0), jnp.full(WIDTH, 4.0)
    np.testing.assert_allclose(norm(jnp.asarray(X[0])), (X[0] - 2) / np.sqrt(4 + 1e-5), rtol=1e-5)
    assert parameter_count(norm) == 2 * WIDTH


def test_running_statistics_follow_the_batch_and_nothing_else_moves_them():
    """r ← 0.9 r + 0.1 b with the unbiased variance, whatever the loss is and the learning rate."""
    norm = BatchNorm(WIDTH)

    def loss(norm, x, counts, scale):
        return scale * jnp.sum(jax.vmap(norm, axis_name=CLIP_AXIS)(x, counts) ** 3)

    optimiser = optimiser_of(OptimiserConfig(clip_norm=1e-3), steps=10)
    for scale in (1.0, 30.0):
        gradient = jax.jit(jax.grad(loss))(norm, X, COUNTS, jnp.asarray(scale))
        change, _ = optimiser.update(gradient, optimiser.init(norm), norm)
        moved = optax.apply_updates(norm, change)
        np.testing.assert_allclose(moved.running_mean[...], 0.1 * ROWS.mean(axis=0), rtol=1e-4)
        np.testing.assert_allclose(moved.running_variance[...], 0.9 + 0.1 * ROWS.var(axis=0, ddof=1), rtol=1e-4)
        assert np.abs(np.asarray(change.weight[...])).max() > 0
    kept = without_statistics(gradient)
    assert float(jnp.abs(kept.running_mean[...]).max()) == 0
    np.testing.assert_array_equal(kept.weight[...], gradient.weight[...])


def test_gradients_pass_through_the_statistics_of_the_batch():
    norm = BatchNorm(WIDTH)
    weight = jnp.asarray(np.random.default_rng(1).normal(size=X.shape).astype(np.float32))

    def ours(x):
        return jnp.sum(apply(norm, x, COUNTS) * weight * COUNTS[..., None, None])

    def written(x):
        rows = jnp.asarray(COUNTS)[..., None, None] / (COUNTS.sum() * 7)
        mean = jnp.sum(x * rows, axis=(0, 1, 2), keepdims=True)
        variance = jnp.sum((x - mean) ** 2 * rows, axis=(0, 1, 2), keepdims=True)
        return jnp.sum((x - mean) / jnp.sqrt(variance + 1e-5) * weight * COUNTS[..., None, None])

    np.testing.assert_allclose(jax.jit(jax.grad(ours))(X), jax.jit(jax.grad(written))(X), atol=2e-4)
