"""Images as functions of the plane: bilinear look-up and the signed distance to a silhouette."""

from __future__ import annotations

from functools import reduce

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from kernels.hull.limits import REACH


def bilinear(
    image: Float[Array, "height width *channel"], pixels: Float[Array, "point 2"]
) -> Float[Array, "point *channel"]:
    """Sample an image at continuous pixels (centres at +0.5); beyond the border the nearest pixel's value."""
    height, width = image.shape[:2]
    x = jnp.clip(pixels[:, 0] - 0.5, 0.0, width - 1.0)
    y = jnp.clip(pixels[:, 1] - 0.5, 0.0, height - 1.0)
    x0 = jnp.minimum(jnp.floor(x).astype(jnp.int32), width - 2)
    y0 = jnp.minimum(jnp.floor(y).astype(jnp.int32), height - 2)
    trailing = (slice(None), *([None] * (image.ndim - 2)))
    fx, fy = (x - x0.astype(x.dtype))[trailing], (y - y0.astype(y.dtype))[trailing]
    flat = image.reshape(height * width, *image.shape[2:])
    at = y0 * width + x0
    top = flat[at] * (1 - fx) + flat[at + 1] * fx
    bottom = flat[at + width] * (1 - fx) + flat[at + width + 1] * fx
    return top * (1 - fy) + bottom * fy


def known_at(known: Bool[Array, "height width"], pixels: Float[Array, "point 2"]) -> Bool[Array, "point"]:
    """Whether continuous pixels lie in known ones; beyond the border the nearest pixel decides."""
    height, width = known.shape
    x = jnp.clip(pixels[:, 0], 0.0, width - 1.0).astype(jnp.int32)
    y = jnp.clip(pixels[:, 1], 0.0, height - 1.0).astype(jnp.int32)
    return known.reshape(-1)[y * width + x]


def known_about(known: Bool[Array, "height width"], pixels: Float[Array, "point 2"]) -> Bool[Array, "point"]:
    """Whether all four pixels that `bilinear` reads are known."""
    corners = ((-0.5, -0.5), (0.5, -0.5), (-0.5, 0.5), (0.5, 0.5))
    return reduce(jnp.logical_and, (known_at(known, pixels + jnp.array([corner])) for corner in corners))


def signed_distance(
    mask: Float[Array, "size size"], known: Bool[Array, "size size"] | None = None, *, reach: int = REACH
) -> Float[Array, "size size"]:
    """Euclidean distance in pixels to the outline of `mask` > 0.5, positive inside, cut off at ±`reach`.

    Two separable lower envelopes (Felzenszwalb & Huttenlocher 2012), each a minimum over 2·reach+1 shifts, exact within
    the reach; an empty mask is far outside everywhere.

    Args:
        mask: coverage.
        known: pixels of which `mask` speaks; where an image ends is no outline. What is not known counts as object for
            pixels of the object and as background for the others; its own pixels have a distance as in the object.
        reach: pixels.
    """
    inside = mask > 0.5
    filled = inside if known is None else inside | ~known
    shown = inside if known is None else inside & known
    # Half a pixel each way: the outline runs between the pixels.
    return jnp.where(filled, _distance_to(~filled, reach) - 0.5, 0.5 - _distance_to(shown, reach))


def _distance_to(target: Array, reach: int) -> Float[Array, "size size"]:
    squares = jnp.where(target, 0.0, float(reach * reach))
    for axis in (0, 1):
        squares = _lower_envelope(squares, axis, reach)
    return jnp.sqrt(squares)


def _lower_envelope(squares: Array, axis: int, reach: int) -> Array:
    size = squares.shape[axis]
    pad = [(0, 0), (0, 0)]
    pad[axis] = (reach, reach)
    padded = jnp.pad(squares, pad, constant_values=float(reach * reach))
    shifts = (
        jax.lax.slice_in_dim(padded, k, k + size, axis=axis) + float((k - reach) ** 2) for k in range(2 * reach + 1)
    )
    return reduce(jnp.minimum, shifts)
