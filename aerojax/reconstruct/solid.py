"""A visual hull filled with faint Gaussians: where a fit starts that must find the surface inside it.

The hull is the largest shape with these silhouettes. Gaussians on its surface alone can only be repainted where it
bulges; a fog through its whole depth lets what is in the wrong place thin out and show what lies behind.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from aerojax.errors import UserError
from aerojax.geometry.cameras import points_in_camera
from aerojax.reconstruct.silhouette import bilinear, signed_distance
from aerojax.types import SH_C0, Gaussians, View

GRIDS = (160, 128, 112, 96, 80, 64, 48, 32, 24, 16)
"""Cells along the cube's side that are tried, finest first."""


@dataclass(frozen=True)
class SolidConfig:
    """Resolution of the fog.

    capacity: Gaussians at most; the finest grid whose cells in the hull are no more is taken.
    extent: side of the cube over the largest width that a crop window has at the object.
    growth: cells by which the hull is grown, so that rods and blades thinner than a cell hold some.
    spread: standard deviation of a Gaussian, cells.
    opacity: of every Gaussian.
    """

    capacity: int = 9000
    extent: float = 1.1
    growth: float = 0.35
    spread: float = 0.5
    opacity: float = 0.15


def solid_gaussians(views: View, *, config: SolidConfig) -> Gaussians:
    """One round Gaussian in every grid cell of the visual hull, in the mean colour that the views have there.

    Args:
        views: crops (leading axis `view`) whose cameras stand in a frame with the object near its origin, metres.
        config: resolution.

    Returns:
        Gaussians in the cameras' frame; their number follows from the object.

    Raises:
        UserError: the silhouettes do not meet.
    """
    depth = jnp.linalg.norm(views.camera.world_from_cam[:, :3, 3], axis=-1)
    side = config.extent * jnp.max(depth * views.camera.width / views.camera.K[:, 0, 0])
    distance = jax.vmap(signed_distance)(views.mask)
    points, cell = np.zeros((0, 3), np.float32), 0.0
    for grid in GRIDS:
        cell = float(side) / grid
        centres, depths = _hull_depths(distance, views, side, grid)
        points = np.asarray(centres)[np.asarray(depths) > -config.growth * cell]
        if len(points) <= config.capacity:
            break
    if len(points) == 0:
        raise UserError("the silhouettes of the cameras do not meet: check calibration, masks and clocks")
    points = points[: config.capacity]
    colour = _mean_colour(jnp.asarray(points), views)
    count = len(points)
    return Gaussians(
        mean=jnp.asarray(points),
        quaternion=jnp.tile(jnp.array([1.0, 0.0, 0.0, 0.0]), (count, 1)),
        scale=jnp.full((count, 3), config.spread * cell),
        opacity=jnp.full(count, config.opacity),
        sh=((colour - 0.5) / SH_C0)[:, None, :],
    )


@partial(jax.jit, static_argnames="grid")
def _hull_depths(
    distance: Float[Array, "view size size"], views: View, side: Float[Array, ""], grid: int
) -> tuple[Float[Array, "cell 3"], Float[Array, "cell"]]:
    """Cell centres, and the least over views of the distance to the silhouette, metres, positive inside."""
    index = jnp.stack(jnp.meshgrid(*[jnp.arange(grid)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    centres = (index - (grid - 1) / 2) * (side / grid)

    def nearer(least: Array, view: tuple[Array, View]) -> tuple[Array, None]:
        pixels, depth = _project(centres, view[1])
        return jnp.minimum(least, bilinear(view[0], pixels) * depth / view[1].camera.K[0, 0]), None

    return centres, jax.lax.scan(nearer, jnp.full(len(centres), jnp.inf), (distance, views))[0]


def _project(points: Float[Array, "point 3"], view: View) -> tuple[Float[Array, "point 2"], Float[Array, "point"]]:
    """Pixels and depths; depth is kept positive."""
    inside = points_in_camera(points, view.camera)
    depth = jnp.maximum(inside[:, 2], 1e-3)
    return inside[:, :2] / depth[:, None] * view.camera.K[0, 0] + view.camera.K[:2, 2], depth


@jax.jit
def _mean_colour(points: Float[Array, "point 3"], views: View) -> Float[Array, "point 3"]:
    """Mean over the views; pixels that the object covers in part hardly count, for they show the backdrop too."""

    def one_view(view: View) -> tuple[Array, Array]:
        pixels, _ = _project(points, view)
        weight = bilinear(view.mask, pixels)[:, None] ** 4 + 1e-4
        return weight * bilinear(view.rgb, pixels), weight

    colours, weights = jax.vmap(one_view)(views)
    return jnp.sum(colours, axis=0) / jnp.sum(weights, axis=0)
