"""Layers of images with channels last, their parameters laid out as in the published weights.

Not `nnx.Conv` and `nnx.Linear`: those store a transposed `kernel`, and the published weights are (out, in, row, column)
and (out, in). All compute in the type of their parameters.
"""

from __future__ import annotations

import math
from typing import Literal

import jax
import jax.numpy as jnp
from flax import nnx
from jaxtyping import Array, Float

from aerojax.reconstruct.depthsplat.draws import Draws

EPSILON = 1e-5
"""Added to variances, except in the monocular branch."""
VISION_DEVIATION = 0.02
"""Of the weights that a vision transformer starts with."""


def gelu(x: Array) -> Array:
    """x·Φ(x) with the exact error function."""
    return jax.nn.gelu(x, approximate=False)


def at_least_float32(x: Array) -> Array:
    """The array in float32, or as it is where it has more digits."""
    return x if x.dtype == jnp.float64 else x.astype(jnp.float32)


def over_last_axis(vector: Float[Array, "width"], like: Array) -> Array:
    """The vector with as many axes in front as `like` has."""
    return vector.reshape((1,) * (like.ndim - 1) + vector.shape)


class Convolution(nnx.Module):
    """A square convolution that keeps the grid, or every `stride`-th cell of it.

    edge: what lies beyond the border: zeros, or the nearest cell.
    start: W and b uniform in ±1/√fan-in, W ~ N(0, 2/fan-out) for what a ReLU follows (He et al. 2015), or zero.
    """

    def __init__(
        self,
        inputs: int,
        outputs: int,
        side: int = 3,
        *,
        draws: Draws,
        stride: int = 1,
        bias: bool = True,
        edge: Literal["zeros", "nearest"] = "zeros",
        start: Literal["uniform", "he", "zero"] = "uniform",
    ):
        bound = 1 / math.sqrt(inputs * side * side)
        shape = (outputs, inputs, side, side)
        if start == "he":
            weight = draws.normal(shape, math.sqrt(2 / (outputs * side * side)))
        else:
            weight = draws.uniform(shape, bound) if start == "uniform" else jnp.zeros(shape)
        self.weight = nnx.Param(weight)
        offset = draws.uniform((outputs,), bound) if start == "uniform" else jnp.zeros(outputs)
        self.bias = nnx.Param(offset) if bias else None
        self.stride, self.edge = stride, edge

    def __call__(self, x: Float[Array, "view height width inputs"]) -> Float[Array, "view rows columns outputs"]:
        """Convolve."""
        weight = self.weight[...]
        reach = weight.shape[-1] // 2
        pad = ((reach, reach), (reach, reach))
        if self.edge == "nearest":
            x, pad = jnp.pad(x, ((0, 0), *pad, (0, 0)), mode="edge"), ((0, 0), (0, 0))
        strides, layout = (self.stride, self.stride), ("NHWC", "OIHW", "NHWC")
        y = jax.lax.conv_general_dilated(x, weight, strides, pad, dimension_numbers=layout)
        return y if self.bias is None else y + over_last_axis(self.bias[...], y)


class Enlargement(nnx.Module):
    """A transposed convolution whose stride is its side: every cell becomes side × side cells of its own."""

    def __init__(self, inputs: int, outputs: int, side: int, *, draws: Draws):
        bound = 1 / math.sqrt(outputs * side * side)
        self.weight = nnx.Param(draws.uniform((inputs, outputs, side, side), bound))
        self.bias = nnx.Param(draws.uniform((outputs,), bound))

    def __call__(self, x: Float[Array, "view height width inputs"]) -> Float[Array, "view rows columns outputs"]:
        """Enlarge."""
        inputs, outputs, side, _ = self.weight[...].shape
        view, height, width, _ = x.shape
        y = x @ self.weight[...].transpose(0, 2, 3, 1).reshape(inputs, side * side * outputs)
        y = y.reshape(view, height, width, side, side, outputs).transpose(0, 1, 3, 2, 4, 5)
        y = y.reshape(view, height * side, width * side, outputs)
        return y + over_last_axis(self.bias[...], y)


class Linear(nnx.Module):
    """y = W x + b over the last axis; b = 0.

    start: W uniform in ±√(6/(in + out)) (Glorot & Bengio 2010), or ~ N(0, 0.02²) as vision transformers have it.
    """

    def __init__(
        self,
        inputs: int,
        outputs: int,
        *,
        draws: Draws,
        bias: bool = True,
        start: Literal["xavier", "vision"] = "xavier",
    ):
        shape = (outputs, inputs)
        xavier = start == "xavier"
        self.weight = nnx.Param(
            draws.uniform(shape, math.sqrt(6 / (inputs + outputs))) if xavier else draws.normal(shape, VISION_DEVIATION)
        )
        self.bias = nnx.Param(jnp.zeros(outputs)) if bias else None

    def __call__(self, x: Float[Array, "*batch inputs"]) -> Float[Array, "*batch outputs"]:
        """Apply."""
        y = x @ self.weight[...].T
        return y if self.bias is None else y + over_last_axis(self.bias[...], y)


class LayerNorm(nnx.Module):
    """(x - mean)/√(var + ε) · gain + bias over the last axis."""

    def __init__(self, width: int, *, epsilon: float = EPSILON):
        self.weight, self.bias = nnx.Param(jnp.ones(width)), nnx.Param(jnp.zeros(width))
        self.epsilon = epsilon

    def __call__(self, x: Float[Array, "*batch width"]) -> Float[Array, "*batch width"]:
        """Normalise."""
        x = _standardised(x, (-1,), self.epsilon)
        return x * over_last_axis(self.weight[...], x) + over_last_axis(self.bias[...], x)


class GroupNorm(nnx.Module):
    """As `LayerNorm`, over all cells of a view and one of 8 groups of channels, or of 4 where 8 do not divide them."""

    def __init__(self, width: int):
        self.weight, self.bias = nnx.Param(jnp.ones(width)), nnx.Param(jnp.zeros(width))

    def __call__(self, x: Float[Array, "view height width channel"]) -> Float[Array, "view height width channel"]:
        """Normalise."""
        channels = x.shape[-1]
        groups = 8 if channels % 8 == 0 else 4
        grouped = x.reshape(*x.shape[:3], groups, channels // groups)
        y = _standardised(grouped, (1, 2, 4), EPSILON).reshape(x.shape)
        return y * over_last_axis(self.weight[...], y) + over_last_axis(self.bias[...], y)


def instance_norm(x: Float[Array, "view height width channel"]) -> Float[Array, "view height width channel"]:
    """(x - mean)/√(var + ε) over the cells of each view and channel."""
    return _standardised(x, (1, 2), EPSILON)


def _standardised(x: Array, axes: tuple[int, ...], epsilon: float) -> Array:
    # Sums over an image need more digits than bfloat16 has.
    wide = at_least_float32(x)
    centred = wide - wide.mean(axis=axes, keepdims=True)
    variance = jnp.mean(centred * centred, axis=axes, keepdims=True)
    return (centred * jax.lax.rsqrt(variance + epsilon)).astype(x.dtype)
