"""The network of B3-lite and B4-lite: crops of one camera, one or some frames of them, become logits."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from flax import nnx
from jaxtyping import Array, Float, Key

from aerojax.classify.images.config import CropConfig
from aerojax.classify.images.convolutions import ConvolutionBlock, highest_of_blocks, quartered
from aerojax.classify.mambasplat.layers import Linear, drop


class CropNetwork(nnx.Module):
    """Three convolutions, each on half the pixels of the one before, mean and maximum over the rest, a linear map."""

    def __init__(self, config: CropConfig, *, key: Key[Array, ""]):
        first, second, third, head = jax.random.split(key, 4)
        width = config.width
        self.first = ConvolutionBlock(16 * config.window, width, key=first)
        self.second = ConvolutionBlock(width, 2 * width, key=second)
        self.third = ConvolutionBlock(2 * width, 4 * width, key=third)
        self.head = Linear(8 * width, config.classes, key=head)
        self.pixels, self.window, self.sample, self.dropout = (
            config.pixels,
            config.window,
            config.sample,
            config.dropout,
        )

    def __call__(
        self, crops: Float[Array, "window pixels pixels 4"], *, key: Key[Array, ""] | None = None
    ) -> Float[Array, "label"]:
        """Logits of one camera's crops, the newest last; `key` turns on dropout."""
        x = jnp.moveaxis(crops, 0, -2).reshape(*crops.shape[1:3], -1)
        x = self.first(quartered(x))
        x = self.third(highest_of_blocks(self.second(highest_of_blocks(x))))
        read = jnp.concatenate([x.mean(axis=(0, 1)), x.max(axis=(0, 1))])
        return self.head(drop(read, self.dropout, key=key))
