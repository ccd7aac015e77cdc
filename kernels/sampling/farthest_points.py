"""Farthest-point sampling: a Warp loop on the CPU, the plain JAX reference on a GPU.

The greedy choice is sequential, so one CPU thread walks it faster than any dense formulation. Points are sorted into
the cells of a coarse grid; a cell whose box is farther from the chosen point than all its points are from the points
chosen before cannot change and is passed over, as in the bucketed search of Han et al. 2023 (QuickFPS). The choice is
exact: what is passed over would have kept its numbers.
"""

from __future__ import annotations

from functools import lru_cache, partial
from typing import Any, no_type_check

import jax
import jax.numpy as jnp
import warp as wp
from jaxtyping import Array, Float, Int

from kernels.sampling.farthest_points_reference import farthest_points as reference

SIDE = 8
"""Cells along the longest side of the points' box: some 100 to 200 of 512 hold points of a surface."""


@no_type_check  # Warp compiles functions from their source; a run-time checker around them would hide it
@lru_cache(maxsize=1)
def _functions() -> Any:
    @wp.func
    def cell_of(point: wp.vec3, low: wp.vec3, cells_per_metre: float, side: int) -> int:
        x = wp.clamp(int((point[0] - low[0]) * cells_per_metre), 0, side - 1)
        y = wp.clamp(int((point[1] - low[1]) * cells_per_metre), 0, side - 1)
        z = wp.clamp(int((point[2] - low[2]) * cells_per_metre), 0, side - 1)
        return (x * side + y) * side + z

    @wp.func
    def sort_into_cells(
        points: wp.array(dtype=wp.vec3), side: int, ends: wp.array(dtype=int), order: wp.array(dtype=int)
    ):
        # Counting sort, stable. A cell's points are order[ends[c - 1]] up to order[ends[c]], ends[-1] being 0.
        n = points.shape[0]
        low = points[0]
        high = points[0]
        for i in range(n):
            low = wp.min(low, points[i])
            high = wp.max(high, points[i])
        extent = high - low
        scale = float(side) / wp.max(wp.max(wp.max(extent[0], extent[1]), extent[2]), 1.0e-30)
        cells = side * side * side
        for c in range(cells):
            ends[c] = 0
        for i in range(n):
            c = cell_of(points[i], low, scale, side)
            ends[c] = ends[c] + 1
        total = int(0)  # noqa: RUF046  Warp reads int(0) as a variable, 0 as a constant
        for c in range(cells):
            members = ends[c]
            ends[c] = total
            total += members
        for i in range(n):
            c = cell_of(points[i], low, scale, side)
            order[ends[c]] = i
            ends[c] = ends[c] + 1

    @wp.func
    def outside(value: float, low: float, high: float) -> float:
        return wp.max(wp.max(low - value, value - high), 0.0)

    return sort_into_cells, outside


@no_type_check
@lru_cache(maxsize=1)
def _kernel() -> Any:
    sort_into_cells, outside = _functions()

    @wp.kernel(enable_backward=False)
    def _farthest(
        points: wp.array(dtype=wp.vec3),
        allowed: wp.array(dtype=wp.bool),
        count: int,
        start: int,
        side: int,
        chosen_out: wp.array(dtype=int),
        order_out: wp.array(dtype=int),
        ends_out: wp.array(dtype=int),
        sorted_out: wp.array(dtype=wp.vec3),
        nearest_out: wp.array(dtype=float),
        first_out: wp.array(dtype=int),
        stop_out: wp.array(dtype=int),
        low_out: wp.array(dtype=wp.vec3),
        high_out: wp.array(dtype=wp.vec3),
        top_out: wp.array(dtype=float),
        top_at_out: wp.array(dtype=int),
    ):
        sort_into_cells(points, side, ends_out, order_out)
        filled = int(0)  # noqa: RUF046
        first = int(0)  # noqa: RUF046
        for c in range(side * side * side):
            stop = ends_out[c]
            if stop > first:
                low = points[order_out[first]]
                high = low
                top = float(-1.0)
                for i in range(first, stop):
                    point = points[order_out[i]]
                    sorted_out[i] = point
                    nearest_out[i] = -1.0
                    if allowed[order_out[i]]:
                        nearest_out[i] = float(wp.inf)
                        top = float(wp.inf)
                    low = wp.min(low, point)
                    high = wp.max(high, point)
                first_out[filled] = first
                stop_out[filled] = stop
                low_out[filled] = low
                high_out[filled] = high
                top_out[filled] = top
                top_at_out[filled] = order_out[first]
                filled += 1
            first = stop
        for b in range(filled, side * side * side):  # JAX looks for NaN in all outputs when asked to
            low_out[b] = wp.vec3(0.0)
            high_out[b] = wp.vec3(0.0)
            top_out[b] = 0.0
        current = start
        for k in range(count):
            chosen_out[k] = current
            centre = points[current]
            best = float(-2.0)
            following = int(0)  # noqa: RUF046
            for b in range(filled):
                low = low_out[b]
                high = high_out[b]
                x = outside(centre[0], low[0], high[0])
                y = outside(centre[1], low[1], high[1])
                z = outside(centre[2], low[2], high[2])
                # A little less than the least square in the cell, whatever the rounding.
                if 0.99999 * (x * x + y * y + z * z) < top_out[b]:
                    top = float(-2.0)
                    for i in range(first_out[b], stop_out[b]):
                        d = sorted_out[i] - centre
                        # The reference sums squares in this order; equal rounding keeps ties equal.
                        nearest = wp.min(nearest_out[i], d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
                        nearest_out[i] = nearest
                        if nearest > top:
                            top = nearest
                            top_at_out[b] = order_out[i]
                    top_out[b] = top
                if top_out[b] > best or (top_out[b] == best and top_at_out[b] < following):
                    best = top_out[b]
                    following = top_at_out[b]
            current = following

    return wp.jax_kernel(_farthest, num_outputs=11, launch_dims=1, vmap_method="sequential")


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
    by_point = ("order_out", "sorted_out", "nearest_out")
    by_cell = ("ends_out", "first_out", "stop_out", "low_out", "high_out", "top_out", "top_at_out")
    dims = {"chosen_out": count} | dict.fromkeys(by_point, points.shape[0]) | dict.fromkeys(by_cell, SIDE**3)
    return _kernel()(points.astype(jnp.float32), allowed, count, start, SIDE, output_dims=dims)[0]
