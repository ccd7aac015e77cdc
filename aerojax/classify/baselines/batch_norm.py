"""Batch normalisation whose running statistics are leaves of the network and learn by the gradient that they are given.

Training here is a function of values: nothing is written in passing. So a layer gives its running statistics r the
gradient r - b, where b are the batch's, and the optimiser moves such leaves (`core.tensors.is_statistic`) by a tenth of
it: r ← 0.9 r + 0.1 b, the rule of Ioffe & Szegedy 2015. Parts of a batch and their mean commute with that rule.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
from flax import nnx
from jaxtyping import Array, Float

from aerojax.classify.base import CLIP_AXIS
from aerojax.classify.mambasplat.layers import over_last_axis


class BatchNorm(nnx.Module):
    """(x - mean)/√(variance + 1e-5) · gain + bias over the last axis.

    Mean and variance are the running ones, or in training those of all clips of the batch.
    """

    def __init__(self, width: int):
        self.weight = nnx.Param(jnp.ones(width))
        self.bias = nnx.Param(jnp.zeros(width))
        self.running_mean = nnx.BatchStat(jnp.zeros(width))
        self.running_variance = nnx.BatchStat(jnp.ones(width))

    def __call__(
        self, x: Float[Array, "row *more width"], counts: Float[Array, "row"] | None = None
    ) -> Float[Array, "row *more width"]:
        """Normalise.

        Args:
            x: of one clip; rows are what is there or is not, such as frames.
            counts: turns on training: 1 for rows that enter the statistics, 0 for others. The call then has to stand
                within a `jax.vmap` over clips whose axis is named `CLIP_AXIS`.
        """
        running = self.running_mean[...], self.running_variance[...]
        if counts is None:
            return self._scaled(x, *running)
        mean, variance, total = batch_statistics(x, counts)
        first = (jax.lax.axis_index(CLIP_AXIS) == 0).astype(x.dtype)
        unbiased = variance * total / jnp.maximum(total - 1, 1.0)
        return _followed(self._scaled(x, mean, variance), running, (mean, unbiased), first)

    def _scaled(self, x: Array, mean: Array, variance: Array) -> Array:
        gain = jax.lax.rsqrt(variance + 1e-5) * self.weight[...]
        return (x - over_last_axis(mean, x)) * over_last_axis(gain, x) + over_last_axis(self.bias[...], x)


def batch_statistics(
    x: Float[Array, "row *more width"], counts: Float[Array, "row"]
) -> tuple[Float[Array, "width"], Float[Array, "width"], Float[Array, ""]]:
    """Mean and biased variance of the last axis over all clips of the batch, and over how many numbers they are."""
    weight = counts.reshape(-1, *(1 for _ in x.shape[1:]))
    axes = tuple(range(x.ndim - 1))
    numbers = counts.sum() * (x.size // (x.shape[0] * x.shape[-1]))
    total = jnp.maximum(jax.lax.psum(numbers, CLIP_AXIS), 1.0)
    mean = jax.lax.psum(jnp.sum(x * weight, axis=axes), CLIP_AXIS) / total
    square = (x - over_last_axis(mean, x)) ** 2
    return mean, jax.lax.psum(jnp.sum(square * weight, axis=axes), CLIP_AXIS) / total, total


@jax.custom_vjp
def _followed(y: Array, running: tuple[Array, Array], batch: tuple[Array, Array], first: Float[Array, ""]) -> Array:
    """y itself; the gradient of `running` is how far it is from `batch`, said once a batch, by its first clip."""
    return y


def _followed_forward(y: Array, running: tuple, batch: tuple, first: Array) -> tuple[Array, tuple]:
    return y, (running, batch, first)


def _followed_backward(saved: tuple, cotangent: Array) -> tuple:
    running, batch, first = saved
    pull = jax.tree.map(lambda old, new: first * (old - new), running, batch)
    return cotangent, pull, jax.tree.map(jnp.zeros_like, batch), jnp.zeros_like(first)


_followed.defvjp(_followed_forward, _followed_backward)
