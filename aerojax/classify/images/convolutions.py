"""Convolutions of the 2D baselines: ordinary ones, because depthwise ones are slow in XLA on a CPU.

They are sums of nine matrix products. As fast as XLA's convolution by itself, and twenty times as fast in a `scan` over
micro-batches, where that one runs on a CPU without its fast path (240 crops forward and back: 0.15 and 2.8 s).
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
from flax import nnx
from jaxtyping import Array, Float, Key

from aerojax.classify.mambasplat.layers import LayerNorm, over_last_axis


class Convolution(nnx.Module):
    """3×3 convolution with zeros beyond the border; weights N(0, 2/fan_in) (He et al. 2015), bias 0."""

    def __init__(self, inputs: int, outputs: int, *, key: Key[Array, ""]):
        self.weight = nnx.Param(jax.random.normal(key, (3, 3, inputs, outputs)) * (2 / (9 * inputs)) ** 0.5)
        self.bias = nnx.Param(jnp.zeros(outputs))

    def __call__(self, x: Float[Array, "height width inputs"]) -> Float[Array, "height width outputs"]:
        """Convolve one image."""
        height, width = x.shape[:2]
        bordered, kernel = jnp.pad(x, ((1, 1), (1, 1), (0, 0))), self.weight[...]
        shifted = [bordered[i : i + height, j : j + width] @ kernel[i, j] for i in range(3) for j in range(3)]
        y = sum(shifted[1:], start=shifted[0])
        return y + over_last_axis(self.bias[...], y)


class ConvolutionBlock(nnx.Module):
    """Convolution, normalisation of each pixel's channels, rectifier."""

    def __init__(self, inputs: int, outputs: int, *, key: Key[Array, ""]):
        self.convolution = Convolution(inputs, outputs, key=key)
        self.norm = LayerNorm(outputs)

    def __call__(self, x: Float[Array, "height width inputs"]) -> Float[Array, "height width outputs"]:
        """One image."""
        return jax.nn.relu(self.norm(self.convolution(x)))


def quartered(x: Float[Array, "height width channel"]) -> Float[Array, "half_height half_width four_channels"]:
    """Blocks of 2×2 pixels side by side in the channels; nothing is lost."""
    height, width, channels = x.shape
    blocks = x.reshape(height // 2, 2, width // 2, 2, channels).transpose(0, 2, 1, 3, 4)
    return blocks.reshape(height // 2, width // 2, 4 * channels)


def highest_of_blocks(x: Float[Array, "height width channel"]) -> Float[Array, "half_height half_width channel"]:
    """The maximum of every block of 2×2 pixels."""
    height, width, channels = x.shape
    return x.reshape(height // 2, 2, width // 2, 2, channels).max(axis=(1, 3))
