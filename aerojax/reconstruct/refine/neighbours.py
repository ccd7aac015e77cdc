"""Which Gaussians exchange, and the lengths that they are measured by."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from aerojax.core.types import Camera, pytree_dataclass
from aerojax.geometry.cameras import points_in_camera


@pytree_dataclass
class Neighbours:
    """Of every Gaussian, nearest first.

    index: which Gaussians. real: whether they are; padding has none and is none.
    """

    index: Int[Array, "gaussian neighbour"]
    real: Bool[Array, "gaussian neighbour"]


def nearest(points: Float[Array, "gaussian 3"], real: Bool[Array, "gaussian"], count: int) -> Neighbours:
    """The nearest other points of every point, from all distances.

    Args:
        points: metres, near their frame's origin.
        real: points that count.
        count: neighbours, fewer than points.
    """
    squares = jnp.sum(points * points, axis=-1)
    # A point's own square orders nothing.
    closeness = 2.0 * points @ points.T - squares[None]
    others = real[None] & ~jnp.eye(len(points), dtype=bool)
    # Behind a barrier: XLA's CPU code sorts whole rows unless the selection is used as it is.
    found = jax.lax.optimization_barrier(jax.lax.top_k(jnp.where(others, closeness, -jnp.inf), count))
    return Neighbours(found[1], jnp.isfinite(found[0]) & real[:, None])


def spacing(points: Float[Array, "gaussian 3"], near: Neighbours) -> Float[Array, "gaussian"]:
    """Mean distance to the neighbours, metres; 0 without."""
    apart = points[near.index] - points[:, None]
    distance = jnp.sqrt(jnp.sum(apart * apart, axis=-1))
    number = jnp.maximum(jnp.sum(near.real, axis=1), 1).astype(distance.dtype)
    return jnp.sum(jnp.where(near.real, distance, 0.0), axis=1) / number


def finest_pixel(
    points: Float[Array, "gaussian 3"], cameras: Camera, seen: Bool[Array, "view #gaussian"]
) -> Float[Array, "gaussian"]:
    """Metres that a pixel spans at each point in the view that samples it most densely; 1 where no view does.

    Args:
        points: metres, in the cameras' frame.
        cameras: of the views.
        seen: views that count; of each point, where they do not show all of them.
    """
    span = jax.vmap(lambda camera: points_in_camera(points, camera)[:, 2] / camera.K[0, 0])(cameras)
    least = jnp.min(jnp.where(seen & (span > 0), span, jnp.inf), axis=0)
    return jnp.where(jnp.isfinite(least), least, 1.0)
