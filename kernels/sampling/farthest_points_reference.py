"""Farthest-point sampling in plain JAX: the twin of `kernels.sampling.farthest_points`, of equal signature."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int


def farthest_points(
    points: Float[Array, "point 3"], count: int, *, start: int = 0, min_square_norm: float | None = None
) -> Int[Array, "count"]:
    """Greedy farthest-point sampling (Gonzalez 1985; Eldar et al. 1997).

    Args:
        points: any frame; float32 squared distances decide, ties go to the lowest index.
        count: how many indices; beyond the number of distinct points, points repeat.
        start: the first index.
        min_square_norm: points at most this near the frame's zero (squared) are chosen only where nothing else is
            left, as the published preprocessing does; None allows all.

    Returns:
        Indices in the order of choice.
    """
    allowed = jnp.ones(points.shape[0], bool)
    if min_square_norm is not None:
        allowed = jnp.sum(points * points, axis=-1) > min_square_norm

    def choose(nearest: Array, chosen: Array) -> tuple[Array, Array]:
        # The maximum keeps products and sum apart: a fused multiply-add would round the ties of a grid differently.
        square = jnp.maximum((points - points[chosen][None]) ** 2, 0.0)
        nearest = jnp.minimum(nearest, square[:, 0] + square[:, 1] + square[:, 2])
        return nearest, jnp.argmax(jnp.where(allowed, nearest, -1.0)).astype(jnp.int32)

    def body(carry: tuple[Array, Array], _: None) -> tuple[tuple[Array, Array], Array]:
        nearest, chosen = carry
        return choose(nearest, chosen), chosen

    first = (jnp.full(points.shape[0], jnp.inf, points.dtype), jnp.asarray(start, jnp.int32))
    return jax.lax.scan(body, first, None, length=count)[1]
