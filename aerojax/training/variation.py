"""How batches of clips are drawn and varied in training."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Literal

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Float32, Int, Key

from aerojax.core.errors import UserError
from aerojax.core.types import Crops, Gaussians
from aerojax.gaussians.rotate import rotate
from aerojax.geometry.rotations import haar_rotation, rotation_about_z
from aerojax.training.crop_variation import CropVariationConfig, vary_images


@dataclass(frozen=True)
class VariationConfig:
    """Training-time variation of a clip.

    frames, tokens: window length and tokens a frame that a batch holds.
    stride: windows start at its multiples.
    jitter: standard deviation of a token's position over the clip's radius.
    colour: strength of the random recolouring (gain and offset a channel).
    drop: share of a frame's tokens that may repeat others, drawn up to this.
    scale: the whole clip becomes larger or smaller by a factor between exp(-scale) and exp(scale).
    axis_scale: the released code's stretch, as in `stretch_axes`, by factors between 1 - axis_scale and 1 + axis_scale.
    shift: the whole clip is moved along each axis by up to this, in its own unit of length.
    rotation: how the whole clip is turned: not at all, about +Z, or uniformly over SO(3).
    crops: how its images are varied, where they are read.
    """

    frames: int = 12
    tokens: int = 128
    stride: int = 1
    jitter: float = 0.01
    colour: float = 0.5
    drop: float = 0.3
    scale: float = 0.0
    axis_scale: float = 0.0
    shift: float = 0.0
    rotation: Literal["none", "z", "so3"] = "none"
    crops: CropVariationConfig = field(default_factory=CropVariationConfig)

    def __post_init__(self) -> None:
        """Refuse what cannot be drawn.

        Raises:
            UserError: names the field and the values that work.
        """
        for name in ("frames", "tokens", "stride"):
            if getattr(self, name) < 1:
                raise UserError("out-of-range", f"variation.{name} is {getattr(self, name)}", "it must be at least 1")
        for name in ("jitter", "colour", "scale", "shift"):
            if getattr(self, name) < 0:
                raise UserError("out-of-range", f"variation.{name} is {getattr(self, name)}", "it must not be negative")
        for name in ("drop", "axis_scale"):
            if not 0 <= getattr(self, name) < 1:
                raise UserError("out-of-range", f"variation.{name} is {getattr(self, name)}", "it lies in [0, 1)")


def epoch_order(count: int, batch: int, *, seed: int, epoch: int) -> Iterator[Int[np.ndarray, "batch"]]:
    """Index batches of one shuffled epoch; the tail that fills no batch is left for another epoch's shuffle."""
    order = np.random.default_rng((seed, epoch)).permutation(count)
    for start in range(0, count - batch + 1, batch):
        yield order[start : start + batch]


def vary_clip(
    columns: Float[Array, "time token 14"],
    present: Bool[Array, "time"],
    config: VariationConfig,
    *,
    key: Key[Array, ""],
) -> tuple[Float[Array, "frames tokens 14"], Bool[Array, "frames tokens"]]:
    """A random window and token subset of a clip, jittered, recoloured, scaled, moved and at last turned.

    The rotation comes last and each draw has its own key, so with and without it a clip is the same up to that
    rotation: an exactly invariant model trains the same under every `rotation`.
    """
    window, tokens, position, gain, offset, count, size, turn = jax.random.split(key, 8)
    index, real = _window(present, config, key=window)
    clip = columns[jnp.minimum(index, columns.shape[0] - 1)]
    keep = 1.0 - config.drop * jax.random.uniform(count)
    order = jax.vmap(lambda k: jax.random.permutation(k, columns.shape[1]))(jax.random.split(tokens, config.frames))
    picked = order[:, : config.tokens] % columns.shape[1]
    visible = jnp.arange(config.tokens).astype(keep.dtype) < keep * config.tokens
    clip = jnp.take_along_axis(clip, picked[:, :, None], axis=1)
    mean = clip[..., :3]
    centre = jnp.mean(mean, axis=1, keepdims=True)
    radius = jnp.sqrt(jnp.mean(jnp.sum((mean - centre) ** 2, axis=-1)) + 1e-12)
    mean = mean + config.jitter * radius * jax.random.normal(position, mean.shape)
    colour = clip[..., 11:] * (1 + config.colour * jax.random.normal(gain, (1, 1, 3)))
    colour = colour + config.colour * jax.random.normal(offset, (1, 1, 3))
    clip = _scale(jnp.concatenate([mean, clip[..., 3:11], colour], axis=-1), config, key=size)
    if config.shift:  # the tenth of the keys of which eight are taken above, and `vary_crops` takes the ninth
        where = jax.random.uniform(jax.random.fold_in(key, 9), (1, 1, 3), minval=-config.shift, maxval=config.shift)
        clip = clip.at[..., :3].add(where)
    return _rotate(clip, config, key=turn), real[:, None] & visible[None, :]


def vary_crops(crops: Crops, present: Bool[Array, "time"], config: VariationConfig, *, key: Key[Array, ""]) -> Crops:
    """The crops of the window that `vary_clip` takes with the same key, varied by `VariationConfig.crops`."""
    window = jax.random.split(key, 8)[0]
    index, real = _window(present, config, key=window)
    index = jnp.minimum(index, present.shape[0] - 1)
    taken = Crops(crops.rgba[index], crops.valid[index] & real[:, None])
    # The ninth of the keys of which `vary_clip` takes eight.
    return vary_images(taken, config.crops, key=jax.random.fold_in(key, 8))


def _window(
    present: Bool[Array, "time"], config: VariationConfig, *, key: Key[Array, ""]
) -> tuple[Int[Array, "frames"], Bool[Array, "frames"]]:
    """Indices of a random window, and which of them are real frames."""
    length = jnp.sum(present)
    starts = jnp.maximum((length - config.frames) // config.stride + 1, 1)
    index = config.stride * jax.random.randint(key, (), 0, starts) + jnp.arange(config.frames)
    return index, index < length


def _scale(
    clip: Float[Array, "frame token 14"], config: VariationConfig, *, key: Key[Array, ""]
) -> Float[Array, "frame token 14"]:
    whole, each = jax.random.split(key)
    if config.scale:
        factor = jnp.exp(jax.random.uniform(whole, minval=-config.scale, maxval=config.scale))
        clip = clip.at[..., :3].multiply(factor).at[..., 7:10].multiply(factor)
    if config.axis_scale:
        factors = jax.random.uniform(each, (3,), minval=1 - config.axis_scale, maxval=1 + config.axis_scale)
        clip = stretch_axes(clip, factors)
    return clip


def stretch_axes(
    columns: Float[Array, "*batch 14"], factors: Float[Array, "3"] | Float32[np.ndarray, "3"]
) -> Float[Array, "*batch 14"]:
    """The released code's stretch: positions along the world's axes, scales along each Gaussian's own.

    A stretched ellipsoid would have other axes, so the covariances no longer fit the positions. It is here for
    comparison; `VariationConfig.scale` is a similarity and keeps them.
    """
    columns = jnp.asarray(columns)
    return columns.at[..., :3].multiply(factors).at[..., 7:10].multiply(factors)


def _rotate(
    clip: Float[Array, "frame token 14"], config: VariationConfig, *, key: Key[Array, ""]
) -> Float[Array, "frame token 14"]:
    """One rotation about the world's origin for all frames, as the test rotations of the protocols are."""
    if config.rotation == "none":
        return clip
    if config.rotation == "z":
        turn = rotation_about_z(jax.random.uniform(key, maxval=2 * jnp.pi))
    else:
        turn = haar_rotation(key=key)
    return rotate(Gaussians.from_columns(clip), turn).columns()
