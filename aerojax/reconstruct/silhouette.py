"""Images as functions of the plane: bilinear look-up and the signed distance to a silhouette."""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Array, Float


def bilinear(image: Float[Array, "height width *channel"], pixels: Float[Array, "point 2"]) -> Float[Array, "point *channel"]:
    """Sample an image at continuous pixels (centres at +0.5); beyond the border the nearest pixel's value."""
    height, width = image.shape[:2]
    x = jnp.clip(pixels[:, 0] - 0.5, 0.0, width - 1.0)
    y = jnp.clip(pixels[:, 1] - 0.5, 0.0, height - 1.0)
    x0 = jnp.minimum(jnp.floor(x).astype(jnp.int32), width - 2)
    y0 = jnp.minimum(jnp.floor(y).astype(jnp.int32), height - 2)
    trailing = (slice(None), *([None] * (image.ndim - 2)))
    fx, fy = (x - x0)[trailing], (y - y0)[trailing]
    flat = image.reshape(height * width, *image.shape[2:])
    at = y0 * width + x0
    top = flat[at] * (1 - fx) + flat[at + 1] * fx
    bottom = flat[at + width] * (1 - fx) + flat[at + width + 1] * fx
    return top * (1 - fy) + bottom * fy


def signed_distance(mask: Float[Array, "size size"]) -> Float[Array, "size size"]:
    """Exact Euclidean distance in pixels to the outline of `mask` > 0.5, positive inside.

    Two separable lower envelopes (Felzenszwalb & Huttenlocher 2012), each as a dense minimum: for crops of a few
    hundred pixels that is faster than the sequential algorithm. An empty mask is far outside everywhere.
    """
    inside = mask > 0.5
    # Half a pixel each way: the outline runs between the pixels.
    return jnp.where(inside, _distance_to(~inside) - 0.5, 0.5 - _distance_to(inside))


def _distance_to(target: Array) -> Float[Array, "size size"]:
    size = target.shape[0]
    far = 4.0 * size * size
    step = (jnp.arange(size)[:, None] - jnp.arange(size)[None, :]).astype(jnp.float32) ** 2
    cost = jnp.where(target, 0.0, far)
    rows = jnp.min(cost[:, None, :] + step[None, :, :], axis=-1)
    both = jnp.min(rows.T[:, None, :] + step[None, :, :], axis=-1).T
    return jnp.sqrt(both)
