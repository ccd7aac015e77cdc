"""Vector-neuron layers with batch norm, as VN-PointNet and VN-DGCNN have them (Deng et al. 2021; vnn's `vn_layers`).

A token is a matrix (slot, channel) with three slots, as in `mambasplat.vector_neurons`. Those layers are others: no
batch norm, and 1e-6 is no part of a denominator there.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
from flax import nnx
from jaxtyping import Array, Float, Key

from aerojax.classify.baselines.batch_norm import BatchNorm
from aerojax.classify.mambasplat.layers import Linear, drop

_EPSILON = 1e-6
Counts = Float[Array, "row"] | None
"""Which rows of a clip enter the statistics of batch norms in training; None outside it."""


class VNBatchNorm(nnx.Module):
    """x/(‖x‖ + 1e-6) · BN(‖x‖ + 1e-6): vectors keep their direction, or are turned round where BN is negative."""

    def __init__(self, channels: int):
        self.norm = BatchNorm(channels)

    def __call__(
        self, x: Float[Array, "row *more 3 channel"], counts: Counts = None
    ) -> Float[Array, "row *more 3 channel"]:
        """Normalise lengths; zero vectors stay zero."""
        # The bound keeps the root's gradient finite at zero and changes no length by more than 1e-12.
        length = jnp.sqrt(jnp.maximum(jnp.sum(x * x, axis=-2), 1e-24)) + _EPSILON
        return x * jnp.expand_dims(self.norm(length, counts) / length, -2)


class VNLinearLeakyReLU(nnx.Module):
    """Linear map → batch norm → vector rectifier, whose directions are another linear map of the input."""

    def __init__(self, inputs: int, outputs: int, *, slope: float, key: Key[Array, ""], shared: bool = False):
        feature, direction = jax.random.split(key)
        self.feature = Linear(inputs, outputs, key=feature, bias=False)
        self.norm = VNBatchNorm(outputs)
        self.direction = Linear(inputs, 1 if shared else outputs, key=direction, bias=False)
        self.slope = slope

    def __call__(
        self, x: Float[Array, "row *more 3 inputs"], counts: Counts = None
    ) -> Float[Array, "row *more 3 outputs"]:
        """p - (1 - slope)·min(⟨p, d⟩, 0)·d/(‖d‖² + 1e-6)."""
        p, d = self.norm(self.feature(x), counts), self.direction(x)
        inner = jnp.sum(p * d, axis=-2, keepdims=True)
        square = jnp.sum(d * d, axis=-2, keepdims=True)
        return p - (1 - self.slope) * jnp.minimum(inner, 0.0) / (square + _EPSILON) * d


class VNStdFeature(nnx.Module):
    """Invariants of each token: its vectors in a frame of three vectors that it makes itself."""

    def __init__(self, channels: int, *, slope: float, key: Key[Array, ""]):
        first, second, frame = jax.random.split(key, 3)
        self.first = VNLinearLeakyReLU(channels, channels // 2, slope=slope, key=first)
        self.second = VNLinearLeakyReLU(channels // 2, channels // 4, slope=slope, key=second)
        self.frame = Linear(channels // 4, 3, key=frame, bias=False)

    def __call__(
        self, x: Float[Array, "row *more 3 channel"], counts: Counts = None
    ) -> Float[Array, "row *more invariant"]:
        """Products of every channel with the three vectors, channel by channel."""
        frame = self.frame(self.second(self.first(x, counts), counts))
        invariants = jnp.einsum("...sc,...sk->...ck", x, frame)
        return invariants.reshape(*x.shape[:-2], -1)


class FrameHead(nnx.Module):
    """Linear → BN → rectifier, twice, then linear; logits of frames.

    Dropout comes before the second batch norm (VN-PointNet) or after each rectifier (VN-DGCNN), as `early` says.
    """

    def __init__(
        self, inputs: int, hidden: tuple[int, int], classes: int, *, slope: float, rate: float, early: bool, key: Array
    ):
        first, second, out = jax.random.split(key, 3)
        self.first, self.first_norm = Linear(inputs, hidden[0], key=first), BatchNorm(hidden[0])
        self.second, self.second_norm = Linear(*hidden, key=second), BatchNorm(hidden[1])
        self.out = Linear(hidden[1], classes, key=out)
        self.slope, self.rate, self.early = slope, rate, early

    def __call__(
        self, x: Float[Array, "row inputs"], counts: Counts = None, *, key: Key[Array, ""] | None = None
    ) -> Float[Array, "row label"]:
        """Logits; `key` turns on dropout."""
        after_first, before, after_second = (None,) * 3 if key is None else jax.random.split(key, 3)
        early, late = (self.rate, 0.0) if self.early else (0.0, self.rate)
        x = self._rectified(self.first_norm(self.first(x), counts))
        x = drop(self.second(drop(x, late, key=after_first)), early, key=before)
        x = self._rectified(self.second_norm(x, counts))
        return self.out(drop(x, late, key=after_second))

    def _rectified(self, x: Array) -> Array:
        return jnp.where(x >= 0, x, self.slope * x)


def with_mean(x: Float[Array, "row token 3 channel"]) -> Float[Array, "row token 3 twice_channel"]:
    """Each token's vectors beside the mean over the frame's tokens."""
    return jnp.concatenate([x, jnp.broadcast_to(x.mean(axis=1, keepdims=True), x.shape)], axis=-1)
