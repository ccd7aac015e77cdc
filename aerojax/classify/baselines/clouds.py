"""Point clouds as the baselines read them: a clip's positions, normalised, every slot of a frame filled."""

from __future__ import annotations

from typing import Literal

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

Normalisation = Literal["frame", "clip", "none"]
"""Whose centroid is subtracted and whose largest distance from it is divided by: each frame's, the clip's, nobody's."""
_LEAST_SQUARE = 1e-24


def clouds(
    columns: Float[Array, "time token 14"], mask: Bool[Array, "time token"], normalisation: str
) -> Float[Array, "time token 3"]:
    """Positions in the unit ball; a slot off the mask repeats a valid token of its frame, a frame without any is zero.

    Published loaders draw points again where a frame has too few, which is what repeating does; the networks need no
    masks within a frame then.
    """
    points = jnp.where(mask[..., None], columns[..., :3], 0.0)
    weight = mask.astype(points.dtype)[..., None]
    if normalisation != "none":
        axes = (1,) if normalisation == "frame" else (0, 1)
        centre = jnp.sum(points, axis=axes, keepdims=True) / jnp.maximum(weight.sum(axes, keepdims=True), 1.0)
        points = (points - centre) * weight
        square = jnp.max(jnp.sum(points * points, axis=-1, keepdims=True), axis=axes, keepdims=True)
        points = points * jax.lax.rsqrt(jnp.maximum(square, _LEAST_SQUARE))
    return jax.vmap(lambda frame, valid: frame[cycled(valid)])(points, mask)


def cycled(valid: Bool[Array, "slot"]) -> Int[Array, "slot"]:
    """Indices of the valid slots in order, again and again until there are as many as slots; 0, 1, … if none is."""
    order = jnp.argsort(~valid, stable=True)
    count = jnp.where(valid.any(), valid.sum(), valid.shape[0])
    return order[jnp.arange(valid.shape[0]) % count]


def nearest(features: Float[Array, "token feature"], count: int) -> Int[Array, "token count"]:
    """Indices of the `count` nearest tokens of each, itself among them; as many as there are if there are fewer."""
    square = jnp.sum(features * features, axis=-1)
    distance = square[:, None] - 2 * features @ features.T + square[None]
    return jax.lax.top_k(-distance, min(count, features.shape[0]))[1]


def in_ball(
    points: Float[Array, "token 3"], anchors: Float[Array, "anchor 3"], radius: float, count: int
) -> Int[Array, "anchor count"]:
    """Indices of the first `count` points nearer to each anchor than `radius`, in their order.

    The first hit fills what is missing; without any hit every index is 0 (Qi et al. 2017, PointNet++, as released).
    """
    square = jnp.sum((anchors[:, None] - points[None]) ** 2, axis=-1)
    hit = square < radius * radius
    size, found = points.shape[0], min(count, points.shape[0])
    # The highest of keys that fall with the index belong to the first hits.
    key, index = jax.lax.top_k(jnp.where(hit, size - jnp.arange(size)[None], 0), found)
    index = jnp.where(key > 0, index, index[:, :1])
    index = jnp.where(hit.any(axis=1, keepdims=True), index, 0)
    return jnp.pad(index, ((0, 0), (0, count - found)), mode="edge")
