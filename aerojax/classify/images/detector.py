"""B1-lite and B3-lite on whole images: a small detector without anchors (after CenterNet, Zhou et al. 2019).

The published B1 (WRN-YOLO), B2 (YOLOv7-tiny) and B3 (FBOD-SV) are other and larger networks; what is shared is what
they read: one image, or five consecutive ones as the channels of one, and that a frame's answer is a box with a class.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import jax
import jax.numpy as jnp
from flax import nnx
from jaxtyping import Array, Float, Int, Key

from aerojax.classify.images.convolutions import Convolution, ConvolutionBlock, highest_of_blocks, quartered
from aerojax.core.errors import UserError
from aerojax.core.types import CLASSES, pytree_dataclass

STRIDE = 8
"""Pixels of the image between two places of the maps."""
PRIOR = 0.01
"""Probability of an object that every place starts with (Lin et al. 2017, focal loss)."""


@dataclass(frozen=True)
class DetectorConfig:
    """A detector.

    frames: consecutive images that are the channels of one: 1 for B1-lite and B2-lite, 5 for B3-lite.
    height, width: of the images that it reads, pixels.
    channels: of its first layer; the others have twice as many.
    classes: number of answers.
    """

    frames: int = 1
    height: int = 352
    width: int = 640
    channels: int = 24
    classes: int = len(CLASSES)

    def __post_init__(self) -> None:
        """Refuse what cannot be built.

        Raises:
            UserError: names the field and a value that works.
        """
        for field in dataclasses.fields(self):
            if (value := getattr(self, field.name)) < 1:
                raise UserError("out-of-range", f"{field.name} is {value} in DetectorConfig", "it must be at least 1")
        for name in ("height", "width"):
            if (value := getattr(self, name)) % (2 * STRIDE):
                problem = f"{name} is {value} in DetectorConfig"
                raise UserError("out-of-range", problem, f"it must be a multiple of {2 * STRIDE}")


@pytree_dataclass
class Maps:
    """What a detector says at every place, `STRIDE` pixels from the next.

    heat: logits of each class having an object's middle there.
    offset: of the middle from the place's top left corner, in strides. extent: logarithms of the box's width and
        height over the stride.
    """

    heat: Float[Array, "*batch rows columns label"]
    offset: Float[Array, "*batch rows columns 2"]
    extent: Float[Array, "*batch rows columns 2"]


@pytree_dataclass
class Detection:
    """The most certain box of an image.

    box: x0, y0, x1, y1, pixels of the image that was read. label: its class. confidence: its probability.
    probabilities: of all classes at its place; each for itself, so that they need not sum to 1.
    """

    box: Float[Array, "*batch 4"]
    label: Int[Array, "*batch"]
    confidence: Float[Array, "*batch"]
    probabilities: Float[Array, "*batch label"]


class Detector(nnx.Module):
    """Convolutions at a quarter, an eighth and a sixteenth of the image; the last one's answer joins the eighth's."""

    def __init__(self, config: DetectorConfig, *, key: Key[Array, ""]):
        keys = dict(zip(("first", "second", "third", "wide", "joined", "out"), jax.random.split(key, 6), strict=True))
        one, two = config.channels, 2 * config.channels
        self.classes = config.classes
        self.first = ConvolutionBlock(48 * config.frames, one, key=keys["first"])
        self.second = ConvolutionBlock(one, two, key=keys["second"])
        self.third = ConvolutionBlock(two, two, key=keys["third"])
        self.wide = ConvolutionBlock(two, two, key=keys["wide"])
        self.joined = ConvolutionBlock(2 * two, two, key=keys["joined"])
        self.out = Convolution(two, config.classes + 4, key=keys["out"])
        level = jnp.log(PRIOR / (1 - PRIOR))
        self.out.bias[...] = jnp.where(jnp.arange(config.classes + 4) < config.classes, level, 0.0)

    def __call__(self, images: Float[Array, "window height width 3"]) -> Maps:
        """Read one camera's consecutive images, sRGB 0..1, the newest last."""
        x = jnp.moveaxis(images - 0.5, 0, -2).reshape(*images.shape[1:3], -1)
        x = highest_of_blocks(self.first(quartered(quartered(x))))
        x = self.second(x)
        around = self.wide(self.third(highest_of_blocks(x)))
        around = jnp.repeat(jnp.repeat(around, 2, axis=0), 2, axis=1)
        found = self.out(self.joined(jnp.concatenate([x, around], axis=-1)))
        heat, offset, extent = jnp.split(found, (self.classes, self.classes + 2), axis=-1)
        return Maps(heat, offset + 0.5, extent)


def most_certain(maps: Maps) -> Detection:
    """The place and class of the highest heat of one image."""
    rows, columns, classes = maps.heat.shape
    place, label = jnp.divmod(jnp.argmax(maps.heat), classes)
    row, column = jnp.divmod(place, columns)
    corner = jnp.stack([column, row]).astype(maps.offset.dtype)
    middle = STRIDE * (corner + maps.offset[row, column])
    half = STRIDE * jnp.exp(jnp.minimum(maps.extent[row, column], jnp.log(float(max(rows, columns))))) / 2
    probabilities = jax.nn.sigmoid(maps.heat[row, column])
    return Detection(jnp.concatenate([middle - half, middle + half]), label, probabilities[label], probabilities)
