"""What it means to train a detector on whole images: its targets, its loss, and what validation counts."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, Key

from aerojax.data.frame_images import FrameImages
from aerojax.training.distribution import own_share
from aerojax.training.loop import TrainingConfig
from aerojax.training.variation import epoch_order

FOCUS, FALL = 2.0, 4.0
"""Exponents of the focal loss: of how wrong a place is, and of how near to the middle (Law & Deng 2018)."""


@dataclass(frozen=True)
class DetectionLossConfig:
    """Weights of the terms besides the heat's, and how images are varied.

    extent: of the box's size. offset: of its middle. colour: images are multiplied by factors between exp(-colour)
        and exp(colour), one a channel.
    """

    extent: float = 0.1
    offset: float = 1.0
    colour: float = 0.3


def heat_target(
    box: Float[Array, "4"], shape: tuple[int, int], stride: float
) -> tuple[Float[Array, "rows columns"], Int[Array, "2"]]:
    """A Gaussian about a box's middle that is 1 in the place of the middle, and that place (row, column).

    Its deviation is a sixth of the box's longer side, at least half a place (after Zhou et al. 2019).
    """
    middle = (box[:2] + box[2:]) / (2 * stride)
    last = jnp.asarray([shape[1] - 1, shape[0] - 1])
    place = jnp.clip(jnp.floor(middle).astype(jnp.int32), 0, last)
    deviation = jnp.maximum(jnp.max(box[2:] - box[:2]) / (6 * stride), 0.5)
    column = (jnp.arange(shape[1]) - place[0]).astype(box.dtype)
    row = (jnp.arange(shape[0]) - place[1]).astype(box.dtype)
    square = row[:, None] ** 2 + column[None] ** 2
    return jnp.exp(-square / (2 * deviation**2)), place[::-1]


def detection_loss(
    maps: Any,
    box: Float[Array, "4"],
    seen: Bool[Array, ""],
    label: Int[Array, ""],
    stride: float,
    config: DetectionLossConfig,
) -> Float[Array, ""]:
    """Penalty-reduced focal loss of the heat, and absolute errors of offset and extent in the box's place.

    Args:
        maps: heat, offset and extent, see `classify.images.detector.Maps`.
        box, seen, label: of the only object; without one every place is background.
        stride: pixels between two places.
        config: weights.
    """
    rows, columns, classes = maps.heat.shape
    height, (row, column) = heat_target(box, (rows, columns), stride)
    target = jnp.where(seen, height[..., None] * jax.nn.one_hot(label, classes)[None, None], 0.0)
    here = jax.nn.sigmoid(maps.heat)
    hit = -((1 - here) ** FOCUS) * jax.nn.log_sigmoid(maps.heat)
    miss = -((1 - target) ** FALL) * here**FOCUS * jax.nn.log_sigmoid(-maps.heat)
    heat = jnp.sum(jnp.where(target == 1.0, hit, miss))
    corner = jnp.stack([column, row]).astype(box.dtype)
    offset = jnp.abs(maps.offset[row, column] - ((box[:2] + box[2:]) / (2 * stride) - corner)).sum()
    size = jnp.log(jnp.maximum(box[2:] - box[:2], 1.0) / stride)
    extent = jnp.abs(maps.extent[row, column] - size).sum()
    return heat + jnp.where(seen, config.offset * offset + config.extent * extent, 0.0)


@dataclass(frozen=True)
class DetectionTask:
    """Images of a run, and how a detector's answers to those of validation are counted.

    detect: maps of one example to its most certain box, as `classify.images.detector.most_certain`.
    """

    train: FrameImages
    val: FrameImages
    training: TrainingConfig
    seed: int
    detect: Callable[[Any], Any]
    loss_config: DetectionLossConfig = field(default_factory=DetectionLossConfig)

    def loss(self, detector: Any, batch: Any, keys: Key[Array, "example"]) -> Float[Array, ""]:
        """Mean over the batch's examples, each mirrored or not and recoloured."""

        def one(images: Array, box: Array, seen: Array, label: Array, key: Array) -> Array:
            images, box = vary_image(images.astype(jnp.float32) / 255, box, self.loss_config, key=key)
            maps = detector(images)
            return detection_loss(maps, box, seen, label, images.shape[1] / maps.heat.shape[0], self.loss_config)

        images, box, seen, label = batch
        return jnp.mean(jax.vmap(one)(images, box, seen, label, keys))

    def batches(self, epoch: int) -> Iterator[Any]:
        """This process' share of each batch of an epoch."""
        images, passes = self.train, self.training.passes
        for number in range(epoch * passes, (epoch + 1) * passes):
            for index in epoch_order(len(images.label), self.training.batch, seed=self.seed, epoch=number):
                share = own_share(index)
                yield images.images[share], images.box[share], images.seen[share], images.label[share]

    def validate(self, detector: Any) -> dict[str, float]:
        """Share of validation images whose object is found, and of those that also have the right class."""
        found = detect_all(detector, self.detect, self.val)
        hits = in_box(found.box, self.val.box) & self.val.seen
        right = hits & (found.label == self.val.label)
        seen = max(int(self.val.seen.sum()), 1)
        return {"found": hits.sum() / seen, "accuracy": right.sum() / seen, "score": right.sum() / seen}

    @property
    def steps_per_epoch(self) -> int:
        """Whole batches of the training images, in all passes."""
        return self.training.passes * (len(self.train.label) // self.training.batch)


def vary_image(
    images: Float[Array, "window height width 3"], box: Float[Array, "4"], config: DetectionLossConfig, *, key: Array
) -> tuple[Float[Array, "window height width 3"], Float[Array, "4"]]:
    """Half of the examples are mirrored, all of their frames alike; each has colours of its own."""
    mirror, colour = jax.random.split(key)
    flip, width = jax.random.bernoulli(mirror), images.shape[2]
    gain = jnp.exp(config.colour * jax.random.uniform(colour, (1, 1, 1, 3), minval=-1.0, maxval=1.0))
    mirrored = jnp.stack([width - box[2], box[1], width - box[0], box[3]])
    return jnp.minimum(jnp.where(flip, images[:, :, ::-1], images) * gain, 1.0), jnp.where(flip, mirrored, box)


@partial(jax.jit, static_argnums=2)
def _read(detector: Any, images: Array, detect: Callable[[Any], Any]) -> Any:
    return jax.vmap(lambda one: detect(detector(one.astype(jnp.float32) / 255)))(images)


def detect_all(detector: Any, detect: Callable[[Any], Any], images: FrameImages, *, batch: int = 8) -> Any:
    """The detector's answer to every example, as arrays on the host."""
    parts, count = [], len(images.label)
    for start in range(0, count, batch):
        index = np.arange(start, start + batch) % count  # one shape, one compilation
        parts.append(jax.tree.map(np.asarray, _read(detector, images.images[index], detect)))
    return jax.tree.map(lambda *leaves: np.concatenate(leaves)[:count], *parts)


def in_box(found: Float[np.ndarray, "example 4"], true: Float[np.ndarray, "example 4"]) -> Bool[np.ndarray, "example"]:
    """Whether the middle of a found box lies in the true one, or within a pixel of it."""
    middle = (found[:, :2] + found[:, 2:]) / 2
    return np.all((middle >= true[:, :2] - 1) & (middle <= true[:, 2:] + 1), axis=1)
