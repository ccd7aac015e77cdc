"""Dense layers of the temporal model and of the heads.

Not `nnx.Linear` and `nnx.LayerNorm`: those store a transposed `kernel` and a `scale`, and weights on disk, ours and the
released ones, have `weight` (out, in).
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
from flax import nnx
from jaxtyping import Array, Float, Key


class LayerNorm(nnx.Module):
    """(x - mean)/√(var + 1e-5) · gain + bias over the last axis."""

    def __init__(self, width: int):
        self.weight = nnx.Param(jnp.ones(width))
        self.bias = nnx.Param(jnp.zeros(width))

    def __call__(self, x: Float[Array, "*batch width"]) -> Float[Array, "*batch width"]:
        """Normalise."""
        centred = x - x.mean(axis=-1, keepdims=True)
        variance = jnp.mean(centred * centred, axis=-1, keepdims=True)
        normalised = centred * jax.lax.rsqrt(variance + 1e-5)
        return normalised * over_last_axis(self.weight[...], x) + over_last_axis(self.bias[...], x)


class Linear(nnx.Module):
    """y = W x + b; W ~ U(±1/√in), b = 0."""

    def __init__(self, inputs: int, outputs: int, *, key: Key[Array, ""], bias: bool = True):
        bound = inputs**-0.5
        self.weight = nnx.Param(jax.random.uniform(key, (outputs, inputs), minval=-bound, maxval=bound))
        self.bias = nnx.Param(jnp.zeros(outputs)) if bias else None

    def __call__(self, x: Float[Array, "*batch inputs"]) -> Float[Array, "*batch outputs"]:
        """Apply to the last axis."""
        y = x @ self.weight[...].T
        return y if self.bias is None else y + over_last_axis(self.bias[...], y)


def over_last_axis(vector: Float[Array, "width"], like: Float[Array, "*batch width"]) -> Float[Array, "*one width"]:
    """The vector with as many axes in front as `like` has."""
    return vector.reshape((1,) * (like.ndim - 1) + vector.shape)


def drop(x: Array, rate: float | Float[Array, ""], *, key: Key[Array, ""] | None, whole: bool = False) -> Array:
    """Inverted dropout of elements, or of the whole array (drop path); the identity without a key."""
    if key is None:
        return x
    keep = jax.random.bernoulli(key, 1 - rate, () if whole else x.shape)
    return jnp.where(keep, x / (1 - rate), 0.0)
