"""How crops are varied in training: hidden in part, rolled, shrunk, coarser, their edges moved, cameras left out."""

from __future__ import annotations

from dataclasses import dataclass

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Key

from aerojax.core.errors import UserError
from aerojax.core.types import Crops
from aerojax.geometry.resampling import sample_bilinear
from aerojax.training.crop_degradation import coarsen, hide, seen_window

_LIMITS = (("edge", 0.45), ("blur", 1.0), ("drop", 1.0), ("lose", 1.0), ("hide", 1.0), ("coarse", 1.0))
"""Largest values of the fields that are shares or lie below one."""


@dataclass(frozen=True)
class CropVariationConfig:
    """Training-time variation of a clip's crops; whatever is drawn stays the same over the clip unless said otherwise.

    roll: whether each camera is rolled about its axis by a uniform angle.
    mirror: whether half of the clips are mirrored, all cameras together.
    shrink: crops shrink by factors between exp(-shrink) and 1, each camera by its own.
    edge: the outline moves to where the coverage was between 0.5 - edge and 0.5 + edge.
    blur: weight, drawn up to this, of a 3×3 binomial filter.
    steepness: the coverage's edge becomes steeper by factors between 1 and exp(steepness).
    colour: colours are multiplied by factors between exp(-colour) and exp(colour), one a channel.
    drop: share of the cameras that are left out, drawn up to this.
    keep: cameras that stay at least, if there are so many.
    lose: probability that a crop is lost, drawn for each camera and frame.
    hide: share of the clips with things in the way of about half of the cameras, as trunks of trees are.
    coarse: share of the clips whose images have larger pixels than the crops; fewest: of those, across a crop. Of the
        default networks, 0.3 and 0.4 of these two made no better ones: 31 for 30 of 37 sequences of validation families
        behind trees, 93.1 for 93.8 % of the factory's clips of them.
    """

    roll: bool = True
    mirror: bool = True
    shrink: float = 0.35
    edge: float = 0.3
    blur: float = 1.0
    steepness: float = 0.5
    colour: float = 0.3
    drop: float = 0.5
    keep: int = 2
    lose: float = 0.03
    hide: float = 0.0
    coarse: float = 0.0
    fewest: float = 6.0

    def __post_init__(self) -> None:
        """Refuse what cannot be drawn.

        Raises:
            UserError: names the field and the values that work.
        """
        for name, most in _LIMITS:
            if not 0 <= getattr(self, name) <= most:
                problem = f"crop variation's {name} is {getattr(self, name)}"
                raise UserError("out-of-range", problem, f"it lies in [0, {most:g}]")
        if self.fewest < 2:
            problem = f"crop variation's fewest is {self.fewest}"
            raise UserError("out-of-range", problem, "a crop needs at least 2 pixels across")
        for name in ("shrink", "steepness", "colour", "keep"):
            if getattr(self, name) < 0:
                problem = f"crop variation's {name} is {getattr(self, name)}"
                raise UserError("out-of-range", problem, "it must not be negative")


def vary_images(crops: Crops, config: CropVariationConfig, *, key: Key[Array, ""]) -> Crops:
    """One variation of a clip's crops (leading axis time) and of which of them count; what does not count is zero."""
    turn, edge, colour, drop = jax.random.split(key, 4)
    # Further keys of this one, so that what was drawn before there were these draws stays as it was.
    hidden, coarse = jax.random.fold_in(key, 4), jax.random.fold_in(key, 5)
    valid = crops.valid
    rgba = jnp.where(valid[..., None, None, None], crops.rgba, jnp.zeros((), crops.rgba.dtype))
    maps = roll_maps(rgba.shape[1], config, key=turn).astype(rgba.dtype)
    middle, over_time = jnp.zeros((rgba.shape[1], 2), rgba.dtype), None  # all frames are read at the same points
    if config.hide:
        whole, shown = rgba[..., 3], hide(rgba[..., 3], config.hide, key=hidden)
        rgba = jnp.where(shown[..., None], rgba, jnp.zeros((), rgba.dtype))
        side, middle, left = seen_window(whole, rgba[..., 3])
        maps, valid, over_time = maps[None] * side[..., None, None], valid & left, 0
    rgba = jax.vmap(jax.vmap(resample), in_axes=(0, over_time, over_time))(rgba, maps, middle)
    if config.coarse:
        rgba = coarsen(rgba, config.coarse, config.fewest, key=coarse)
    rgba = move_edges(rgba, config, key=edge)
    gain = jnp.exp(config.colour * jax.random.uniform(colour, (3,), rgba.dtype, minval=-1.0, maxval=1.0))
    tinted = jnp.minimum(rgba[..., :3] * gain.reshape((1,) * 4 + (3,)), rgba[..., 3:])
    kept = leave_out(valid, config, key=drop)
    return Crops(jnp.concatenate([tinted, rgba[..., 3:]], axis=-1), kept)


def roll_maps(views: int, config: CropVariationConfig, *, key: Key[Array, ""]) -> Float[Array, "view 2 2"]:
    """From offsets in the varied crop to offsets in the given one: each camera's roll and zoom, one mirroring."""
    roll, mirror, zoom = jax.random.split(key, 3)
    angle = config.roll * 2 * jnp.pi * jax.random.uniform(roll, (views,))
    flip = jnp.where(config.mirror & jax.random.bernoulli(mirror), -1.0, 1.0)
    enlarge = jnp.exp(config.shrink * jax.random.uniform(zoom, (views,)))
    cosine, sine = enlarge * jnp.cos(angle), enlarge * jnp.sin(angle)
    rows = [jnp.stack([flip * cosine, -flip * sine], axis=-1), jnp.stack([sine, cosine], axis=-1)]
    return jnp.stack(rows, axis=-2)


def resample(
    crop: Float[Array, "size size channel"], given_from_varied: Float[Array, "2 2"], middle: Float[Array, "2"]
) -> Float[Array, "size size channel"]:
    """A crop under a linear map from offsets about its own middle to offsets about `middle`, bilinear.

    Args:
        crop: given.
        given_from_varied: the map.
        middle: x y from the middle of the given crop, pixels.

    Returns:
        the varied crop, black where the given one ends.
    """
    size = crop.shape[0]
    offset = jnp.arange(size, dtype=crop.dtype) + jnp.asarray(0.5 - size / 2, crop.dtype)
    grid = jnp.stack(jnp.meshgrid(offset, offset, indexing="xy"), axis=-1).reshape(-1, 2)
    points = grid @ given_from_varied.T + middle[None] + jnp.asarray(size / 2, crop.dtype)
    return sample_bilinear(crop, points).reshape(crop.shape)


def move_edges(
    rgba: Float[Array, "time view size size 4"], config: CropVariationConfig, *, key: Key[Array, ""]
) -> Float[Array, "time view size size 4"]:
    """Blur the clip, then move and steepen the edge of its coverage; colours follow what they are multiplied by."""
    blur, shift, steep = jax.random.uniform(key, (3,), rgba.dtype)
    weight = config.blur * blur
    rgba = (1 - weight) * rgba + weight * _smooth(_smooth(rgba, axis=2), axis=3)
    gain = jnp.exp(config.steepness * steep)
    level = 0.5 - config.edge * (2 * shift - 1)
    coverage = rgba[..., 3:]
    # Piecewise linear: none stays none, full stays full, and what was at the level becomes one half.
    span = jnp.where(coverage < level, level, 1 - level)
    moved = jnp.clip(0.5 + 0.5 * gain * (coverage - level) / span, 0.0, 1.0)
    ratio = moved / jnp.maximum(coverage, 1e-6)
    return jnp.concatenate([rgba[..., :3] * ratio, moved], axis=-1)


def _smooth(images: Array, *, axis: int) -> Array:
    """The binomial filter along one axis; the outermost pixels see black beyond the border."""
    size = images.shape[axis]
    padding = [(0, 0)] * images.ndim
    padding[axis] = (1, 1)
    padded = jnp.pad(images, padding)
    before, here, after = (jax.lax.slice_in_dim(padded, i, i + size, axis=axis) for i in range(3))
    return 0.25 * before + 0.5 * here + 0.25 * after


def leave_out(
    valid: Bool[Array, "time view"], config: CropVariationConfig, *, key: Key[Array, ""]
) -> Bool[Array, "time view"]:
    """The crops that still count when some cameras are left out of the clip and some crops of the others are lost."""
    rate_key, camera_key, lost_key = jax.random.split(key, 3)
    rate = config.drop * jax.random.uniform(rate_key)
    # Cameras that never count come last, so that they are not among those that are kept.
    chance = jnp.where(valid.any(axis=0), jax.random.uniform(camera_key, valid.shape[1:]), -1.0)
    rank = jnp.argsort(jnp.argsort(-chance))
    stays = (chance >= rate) | (rank < config.keep)
    lost = jax.random.bernoulli(lost_key, config.lose, valid.shape)
    return valid & stays[None] & ~lost
