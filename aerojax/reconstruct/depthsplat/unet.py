"""The network that turns a cost volume and features into features of depth: a U-Net with attention over all views.

(Rombach et al. 2022's U-Net without its time embedding, as DepthSplat uses it.)
"""

from __future__ import annotations

import math

import jax
import jax.numpy as jnp
from flax import nnx
from jaxtyping import Array, Bool, Float

from aerojax.reconstruct.depthsplat.config import DepthSplatSizes
from aerojax.reconstruct.depthsplat.draws import Draws
from aerojax.reconstruct.depthsplat.grids import repeat
from aerojax.reconstruct.depthsplat.layers import Convolution, GroupNorm, at_least_float32, gelu
from aerojax.reconstruct.depthsplat.transformer import HIDDEN

LEVELS = 3
"""Resolutions of the U-Net: that of the cost volume, 1/2 and 1/4 of it; attention is at the last."""


class ResidualBlock(nnx.Module):
    """norm-SiLU-convolution twice beside a shortcut; the second convolution starts at zero."""

    def __init__(self, inputs: int, outputs: int, *, draws: Draws):
        self.norm_first = GroupNorm(inputs)
        self.first = Convolution(inputs, outputs, draws=draws)
        self.norm_second = GroupNorm(outputs)
        self.second = Convolution(outputs, outputs, draws=draws, start="zero")
        self.shortcut = Convolution(inputs, outputs, 1, draws=draws) if inputs != outputs else None

    def __call__(self, x: Float[Array, "view height width inputs"]) -> Float[Array, "view height width outputs"]:
        """One block."""
        y = self.first(jax.nn.silu(self.norm_first(x)))
        y = self.second(jax.nn.silu(self.norm_second(y)))
        return (x if self.shortcut is None else self.shortcut(x)) + y


class JointAttention(nnx.Module):
    """Attention of the cells of all views to each other, without positions; the projection starts at zero."""

    def __init__(self, width: int, head: int, *, draws: Draws):
        self.norm = GroupNorm(width)
        self.qkv = Convolution(width, 3 * width, 1, draws=draws)
        self.out = Convolution(width, width, 1, draws=draws, start="zero")
        self.heads = width // head

    def __call__(
        self, x: Float[Array, "view height width channel"], valid: Bool[Array, "view"]
    ) -> Float[Array, "view height width channel"]:
        """The features with what the cells of valid views say."""
        view, height, width, channel = x.shape
        # Channels are ordered by head first, then query, key and value.
        split = self.qkv(self.norm(x)).reshape(view * height * width, self.heads, 3, -1)
        query, key, value = split[:, :, 0], split[:, :, 1], split[:, :, 2]
        scores = jnp.einsum("thc,khc->htk", query, key) / math.sqrt(query.shape[-1])
        scores = at_least_float32(scores)
        absent = jnp.repeat(jnp.where(valid, 0.0, HIDDEN), height * width).astype(scores.dtype)
        share = jax.nn.softmax(scores + absent[None, None], axis=-1).astype(x.dtype)
        mixed = jnp.einsum("htk,khc->thc", share, value)
        return x + self.out(mixed.reshape(view, height, width, channel))


class Stage(nnx.Module):
    """A residual block, and behind it attention where there is any."""

    def __init__(self, inputs: int, config: DepthSplatSizes, *, attends: bool, draws: Draws):
        width = config.unet_width
        self.block = ResidualBlock(inputs, width, draws=draws)
        self.attention = JointAttention(width, config.unet_head, draws=draws) if attends else None

    def __call__(
        self, x: Float[Array, "view height width inputs"], valid: Bool[Array, "view"]
    ) -> Float[Array, "view height width outputs"]:
        """One stage."""
        x = self.block(x)
        return x if self.attention is None else self.attention(x, valid)


class UNet(nnx.Module):
    """Down by strided convolutions, up by doubling and convolution, every map on the way down kept for the way up."""

    def __init__(self, config: DepthSplatSizes, *, draws: Draws):
        width, last = config.unet_width, LEVELS - 1
        self.stem = Convolution(width, width, draws=draws)
        self.down = nnx.List([Stage(width, config, attends=level == last, draws=draws) for level in range(LEVELS)])
        self.halve = nnx.List([Convolution(width, width, draws=draws, stride=2) for _ in range(last)])
        self.middle = nnx.List([ResidualBlock(width, width, draws=draws) for _ in range(2)])
        self.up = nnx.List([Stage(2 * width, config, attends=i < 2, draws=draws) for i in range(2 * LEVELS)])
        self.double = nnx.List([Convolution(width, width, draws=draws) for _ in range(last)])
        self.norm = GroupNorm(width)
        self.out = Convolution(width, width, draws=draws, start="zero")

    def __call__(
        self, x: Float[Array, "view height width channel"], valid: Bool[Array, "view"]
    ) -> Float[Array, "view height width channel"]:
        """Features of the same shape."""
        x = self.stem(x)
        kept = [x]
        for level, stage in enumerate(self.down):
            x = stage(x, valid)
            kept.append(x)
            if level < LEVELS - 1:
                x = self.halve[level](x)
                kept.append(x)
        for block in self.middle:
            x = block(x)
        for index, stage in enumerate(self.up):
            x = stage(jnp.concatenate([x, kept.pop()], axis=-1), valid)
            if index % 2 and index < 2 * LEVELS - 1:
                x = self.double[index // 2](repeat(x, 2))
        return self.out(jax.nn.silu(self.norm(x)))


class CostRegressor(nnx.Module):
    """Cost volume and features → features of depth: a U-Net between convolutions beside one linear map."""

    def __init__(self, inputs: int, config: DepthSplatSizes, *, draws: Draws):
        self.first = Convolution(inputs, config.unet_width, draws=draws)
        self.norm = GroupNorm(config.unet_width)
        self.unet = UNet(config, draws=draws)
        self.last = Convolution(config.unet_width, config.unet_width, draws=draws)
        self.straight = Convolution(inputs, config.unet_width, 1, draws=draws)

    def __call__(
        self, x: Float[Array, "view height width inputs"], valid: Bool[Array, "view"]
    ) -> Float[Array, "view height width outputs"]:
        """Features of depth."""
        return self.last(self.unet(self.stem(x), valid)) + self.straight(x)

    def stem(self, x: Float[Array, "view height width inputs"]) -> Float[Array, "view height width outputs"]:
        """What the U-Net reads."""
        return gelu(self.norm(self.first(x)))
