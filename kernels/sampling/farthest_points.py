"""Farthest-point sampling: a Warp loop on the CPU, the plain JAX reference on a GPU.

The greedy choice is sequential, so one CPU thread walks it faster than any dense formulation: one pass over the cloud
per chosen point updates distances and finds the next one together.
"""

from __future__ import annotations

from functools import lru_cache, partial
from typing import Any, no_type_check

import jax
import jax.numpy as jnp
import warp as wp
from jaxtyping import Array, Float, Int

from kernels.sampling.farthest_points_reference import farthest_points as reference


@no_type_check  # Warp compiles the kernel from its source; a run-time checker around it would hide it
@lru_cache(maxsize=1)
def _kernel() -> Any:
    @wp.kernel
    def _farthest(
        points: wp.array(dtype=wp.vec3),
        allowed: wp.array(dtype=wp.bool),
        count: int,
        start: int,
        chosen_out: wp.array(dtype=int),
        nearest_out: wp.array(dtype=float),
    ):
        n = points.shape[0]
        for i in range(n):
            nearest_out[i] = float(wp.inf)
        current = start
        for k in range(count):
            chosen_out[k] = current
            centre = points[current]
            best = float(-2.0)
            following = int(0)  # noqa: RUF046  Warp reads int(0) as a variable, 0 as a constant
            for i in range(n):
                d = points[i] - centre
                # The reference sums squares in this order; equal rounding keeps ties equal.
                square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
                nearest = wp.min(nearest_out[i], square)
                nearest_out[i] = nearest
                value = wp.where(allowed[i], nearest, -1.0)
                if value > best:
                    best = value
                    following = i
            current = following

    return wp.jax_kernel(_farthest, num_outputs=2, launch_dims=1, vmap_method="sequential")


def farthest_points(
    points: Float[Array, "point 3"], count: int, *, start: int = 0, min_square_norm: float | None = None
) -> Int[Array, "count"]:
    """As `kernels.sampling.farthest_points_reference.farthest_points`, index for index."""
    return jax.lax.platform_dependent(
        points,
        cpu=partial(_on_cpu, count=count, start=start, min_square_norm=min_square_norm),
        default=partial(reference, count=count, start=start, min_square_norm=min_square_norm),
    )


def _on_cpu(points: Array, *, count: int, start: int, min_square_norm: float | None) -> Array:
    allowed = jnp.ones(points.shape[0], bool)
    if min_square_norm is not None:
        allowed = jnp.sum(points * points, axis=-1) > min_square_norm
    dims = {"chosen_out": count, "nearest_out": points.shape[0]}
    chosen, _ = _kernel()(points.astype(jnp.float32), allowed, count, start, output_dims=dims)
    return chosen
