"""A silhouette about its own centre: moments, and its image on a polar grid scaled by its own radius."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from aerojax.core.types import pytree_dataclass
from aerojax.geometry.resampling import sample_bilinear

LEAST_AREA = 0.5
"""Pixels of coverage below which a crop shows nothing."""
PIXEL_VARIANCE = 1 / 12
"""Of a uniform position within a pixel, square pixels: it keeps the moments of a line or a point away from zero."""
OVERSAMPLING = 2
"""Samples averaged for each angle of the grid: its outer cells are wider than a pixel."""


@pytree_dataclass
class Moments:
    """Moments of coverage over a crop, pixels (x right, y down; the top left pixel's centre is (0.5, 0.5)).

    area: sum of the coverage.
    centre: its mean position; the crop's middle where there is no coverage.
    trace, difference, product: of the covariance, sxx+syy, sxx-syy and 2·sxy, square pixels.
    """

    area: Float[Array, "*batch"]
    centre: Float[Array, "*batch 2"]
    trace: Float[Array, "*batch"]
    difference: Float[Array, "*batch"]
    product: Float[Array, "*batch"]

    @property
    def radius(self) -> Float[Array, "*batch"]:
        """Root mean square distance from the centre, pixels; never zero."""
        return jnp.sqrt(self.trace)


def pixel_centres(size: int) -> Float[np.ndarray, "size"]:
    """Along either axis of a crop, pixels."""
    return np.arange(size, dtype=np.float32) + np.float32(0.5)


def moments(coverage: Float[Array, "size size"]) -> Moments:
    """Of one crop's coverage, 0..1, rows downward."""
    at = jnp.asarray(pixel_centres(coverage.shape[0]), coverage.dtype)
    area = coverage.sum()
    share = coverage / jnp.maximum(area, 1e-6)
    along_x, along_y = share.sum(axis=0), share.sum(axis=1)
    shows = area > LEAST_AREA
    middle = jnp.asarray(coverage.shape[0] / 2, coverage.dtype)
    x, y = jnp.where(shows, along_x @ at, middle), jnp.where(shows, along_y @ at, middle)
    xx, yy = along_x @ (at - x) ** 2, along_y @ (at - y) ** 2
    xy = (at - y) @ share @ (at - x)
    return Moments(area, jnp.stack([x, y]), xx + yy + 2 * PIXEL_VARIANCE, xx - yy, 2 * xy)


def polar_grid(radii: int, angles: int, reach: float) -> Float[np.ndarray, "radius sample 2"]:
    """Offsets from the centre in units of the silhouette's radius; `OVERSAMPLING` samples an angle, in turn order."""
    radius = (np.arange(radii) + 0.5) / radii * reach
    samples = angles * OVERSAMPLING
    angle = (np.arange(samples) + 0.5) / samples * 2 * np.pi
    directions = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return (radius[:, None, None] * directions[None]).astype(np.float32)


def polar_image(
    image: Float[Array, "size size channel"], about: Moments, *, radii: int, angles: int, reach: float
) -> Float[Array, "radius angle channel"]:
    """The crop about its silhouette's centre: a camera's roll shifts the angle axis, distance changes nothing.

    Both hold up to interpolation. Rows go from the centre to `reach` root mean square radii.
    """
    grid = jnp.asarray(polar_grid(radii, angles, reach), image.dtype).reshape(-1, 2)
    points = about.centre[None] + about.radius * grid
    found = sample_bilinear(image, points)
    return found.reshape(radii, angles, OVERSAMPLING, image.shape[-1]).mean(axis=2)


def fourier_magnitudes(
    values: Float[Array, "angle channel"], lowest: int, highest: int
) -> Float[Array, "frequency channel"]:
    """Magnitudes of angular frequencies, over the number of angles: unchanged by a shift of the angle axis."""
    count = values.shape[0]
    phase = 2 * np.pi * np.outer(np.arange(lowest, highest + 1), np.arange(count)) / count
    cosine, sine = (jnp.asarray(wave / count, values.dtype) for wave in (np.cos(phase), np.sin(phase)))
    # The small term keeps the root's slope finite at zero.
    return jnp.sqrt((cosine @ values) ** 2 + (sine @ values) ** 2 + 1e-8)


def last_before(valid: Bool[Array, "time view"]) -> tuple[Int[Array, "time view"], Bool[Array, "time view"]]:
    """Of each frame and view the last frame before it in which the view was valid, and whether there is one."""
    time = jnp.arange(valid.shape[0])[:, None]
    latest = jax.lax.cummax(jnp.where(valid, time, -1), axis=0)
    before = jnp.concatenate([jnp.full_like(latest[:1], -1), latest[:-1]])
    return jnp.maximum(before, 0), before >= 0
