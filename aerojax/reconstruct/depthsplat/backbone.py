"""Convolutional features of every view at half and quarter resolution (UniMatch's encoder, Xu et al. 2023)."""

from __future__ import annotations

import itertools

import jax
from flax import nnx
from jaxtyping import Array, Float

from aerojax.core.types import pytree_dataclass
from aerojax.reconstruct.depthsplat.config import DepthSplatSizes
from aerojax.reconstruct.depthsplat.draws import Draws
from aerojax.reconstruct.depthsplat.layers import Convolution, instance_norm


@pytree_dataclass
class Pyramid:
    """Features of every view: two maps at 1/2 and one at 1/4 of the resolution."""

    half_first: Float[Array, "view half half channel"]
    half: Float[Array, "view half half channel_2"]
    quarter: Float[Array, "view quarter quarter channel_3"]


class ResidualBlock(nnx.Module):
    """Two convolutions with instance norm and ReLU beside a shortcut, a convolution where the shape changes."""

    def __init__(self, inputs: int, outputs: int, stride: int = 1, *, draws: Draws):
        self.first = Convolution(inputs, outputs, draws=draws, stride=stride, bias=False, start="he")
        self.second = Convolution(outputs, outputs, draws=draws, bias=False, start="he")
        same = stride == 1 and inputs == outputs
        self.shortcut = None if same else Convolution(inputs, outputs, 1, draws=draws, stride=stride, start="he")

    def __call__(self, x: Float[Array, "view height width inputs"]) -> Float[Array, "view rows columns outputs"]:
        """Convolve."""
        y = jax.nn.relu(instance_norm(self.first(x)))
        y = jax.nn.relu(instance_norm(self.second(y)))
        return jax.nn.relu((x if self.shortcut is None else instance_norm(self.shortcut(x))) + y)


class Backbone(nnx.Module):
    """7×7 convolution of stride 2, then three stages of two residual blocks, the last of stride 2."""

    def __init__(self, config: DepthSplatSizes, *, draws: Draws):
        widths = (config.stem_width, config.stem_width, config.half_width, config.width)
        self.stem = Convolution(3, widths[0], 7, draws=draws, stride=2, bias=False, start="he")
        blocks = []
        for stage, (inputs, outputs) in enumerate(itertools.pairwise(widths)):
            blocks.append(ResidualBlock(inputs, outputs, 2 if stage == 2 else 1, draws=draws))
            blocks.append(ResidualBlock(outputs, outputs, draws=draws))
        self.blocks = nnx.List(blocks)
        self.out = Convolution(config.width, config.width, 1, draws=draws, start="he")

    def __call__(self, images: Float[Array, "view height width 3"]) -> Pyramid:
        """Features of normalised images."""
        x = jax.nn.relu(instance_norm(self.stem(images)))
        maps = []
        for index, block in enumerate(self.blocks):
            x = block(x)
            if index % 2:
                maps.append(x)
        return Pyramid(maps[0], maps[1], self.out(maps[2]))
