"""Images read at points between their pixels, in JAX."""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Array, Float


def sample_bilinear(
    image: Float[Array, "height width channel"], points: Float[Array, "point 2"]
) -> Float[Array, "point channel"]:
    """The image at points (x right, y down, pixels; centres at +0.5), black beyond its border."""
    height, width, _ = image.shape
    # One black pixel in front and two behind: the last position has a neighbour of its own.
    rows = jnp.pad(image, ((1, 2), (1, 2), (0, 0))).reshape((height + 3) * (width + 3), -1)
    furthest = jnp.asarray([width + 1, height + 1], points.dtype)
    at = jnp.clip(points + jnp.asarray(0.5, points.dtype), jnp.zeros_like(points), furthest[None])
    low = jnp.floor(at)
    x, y = (at - low)[:, :1], (at - low)[:, 1:]
    cell = low.astype(jnp.int32)
    index = cell[:, 1] * (width + 3) + cell[:, 0]

    def corner(offset: int) -> Float[Array, "point channel"]:
        return rows.at[index + offset].get(mode="clip")

    above = corner(0) * (1 - x) + corner(1) * x
    return above * (1 - y) + (corner(width + 3) * (1 - x) + corner(width + 4) * x) * y
