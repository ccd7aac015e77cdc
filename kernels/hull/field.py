"""Signed distance to silhouettes and, from it, to their hull on a grid (NVIDIA Warp).

The arithmetic, and its order, is that of `aerojax.reconstruct.hull` and `aerojax.reconstruct.silhouette`.
No `from __future__ import annotations` here: Warp reads the annotations of closures, which must be types, not strings.
"""

from functools import lru_cache
from typing import Any, NamedTuple, no_type_check

import warp as wp

mat34 = wp.types.matrix(shape=(3, 4), dtype=float)


class FieldKernels(NamedTuple):
    """The first four make the images' distances, `coarse` and `fine` the grid's; `near` finds the surface's cells."""

    row_distance: wp.Kernel
    column_gap: wp.Kernel
    signed_distance: wp.Kernel
    outside: wp.Kernel
    coarse: wp.Kernel
    fine: wp.Kernel
    near: wp.Kernel


@no_type_check  # Warp compiles functions from their source; a run-time checker around them would hide it
@lru_cache(maxsize=1)
def image_functions():
    """Warp functions: world point → pixel and depth; bilinear look-up in images; whether the nearest pixel, or all that
    the look-up reads, are known."""

    @wp.func
    def pixel_and_depth(point: wp.vec3, cam_from_world: mat34, K: wp.mat33) -> wp.vec3:
        m = cam_from_world
        x = m[0, 0] * point[0] + m[0, 1] * point[1] + m[0, 2] * point[2] + m[0, 3]
        y = m[1, 0] * point[0] + m[1, 1] * point[1] + m[1, 2] * point[2] + m[1, 3]
        z = wp.max(m[2, 0] * point[0] + m[2, 1] * point[1] + m[2, 2] * point[2] + m[2, 3], 1.0e-3)
        across = x / z
        down = y / z
        return wp.vec3(K[0, 0] * across + K[0, 2] + K[0, 1] * down, K[1, 1] * down + K[1, 2], z)

    @wp.func
    def sample_at(images: wp.array3d(dtype=Any), view: int, u: float, v: float):
        height = images.shape[1]
        width = images.shape[2]
        x = wp.clamp(u - 0.5, 0.0, float(width) - 1.0)
        y = wp.clamp(v - 0.5, 0.0, float(height) - 1.0)
        x0 = wp.min(int(x), width - 2)
        y0 = wp.min(int(y), height - 2)
        fx = x - float(x0)
        fy = y - float(y0)
        top = images[view, y0, x0] * (1.0 - fx) + images[view, y0, x0 + 1] * fx
        bottom = images[view, y0 + 1, x0] * (1.0 - fx) + images[view, y0 + 1, x0 + 1] * fx
        return top * (1.0 - fy) + bottom * fy

    @wp.func
    def known_at(known: wp.array3d(dtype=wp.bool), view: int, u: float, v: float) -> bool:
        if known.shape[0] == 0:
            return True
        x = int(wp.clamp(u, 0.0, float(known.shape[2]) - 1.0))
        y = int(wp.clamp(v, 0.0, float(known.shape[1]) - 1.0))
        return known[view, y, x]

    @wp.func
    def known_about(known: wp.array3d(dtype=wp.bool), view: int, u: float, v: float) -> bool:
        # The four pixels that `sample_at` reads.
        above = known_at(known, view, u - 0.5, v - 0.5) and known_at(known, view, u + 0.5, v - 0.5)
        return above and known_at(known, view, u - 0.5, v + 0.5) and known_at(known, view, u + 0.5, v + 0.5)

    return pixel_and_depth, sample_at, known_at, known_about


@no_type_check
@lru_cache(maxsize=1)
def grid_functions():
    """Warp functions: centre of a cell; gradient of the field there, one-sided at the cube's faces."""

    @wp.func
    def centre(i: int, j: int, k: int, cell: float, grid: int) -> wp.vec3:
        middle = float(grid - 1) / 2.0
        return wp.vec3((float(i) - middle) * cell, (float(j) - middle) * cell, (float(k) - middle) * cell)

    @wp.func
    def slope(before: float, here: float, after: float, at: int, grid: int) -> float:
        if at == 0:
            return after - here
        if at == grid - 1:
            return here - before
        return (after - before) * 0.5

    @wp.func
    def gradient(field: wp.array3d(dtype=float), i: int, j: int, k: int, cell: float) -> wp.vec3:
        n = field.shape[0]
        here = field[i, j, k]
        x = slope(field[wp.max(i - 1, 0), j, k], here, field[wp.min(i + 1, n - 1), j, k], i, n)
        y = slope(field[i, wp.max(j - 1, 0), k], here, field[i, wp.min(j + 1, n - 1), k], j, n)
        z = slope(field[i, j, wp.max(k - 1, 0)], here, field[i, j, wp.min(k + 1, n - 1)], k, n)
        return wp.vec3(x / cell, y / cell, z / cell)

    return centre, gradient


@no_type_check
@lru_cache(maxsize=1)
def field_kernels() -> FieldKernels:
    """All kernels of the field, compiled at their first launch."""
    pixel_and_depth, sample_at, known_at, _ = image_functions()
    centre, gradient = grid_functions()

    @wp.kernel(enable_backward=False)
    def _row_distance(mask: wp.array3d(dtype=float), reach: int, squares: wp.array3d(dtype=int)):
        # Squared distance along the row to the nearest pixel of the other kind, at most reach²; negative outside.
        view, y = wp.tid()
        width = mask.shape[2]
        since = reach
        before = mask[view, y, 0] > 0.5
        for x in range(width):
            inside = mask[view, y, x] > 0.5
            since = wp.min(since + 1, reach)
            if inside != before:
                since = 1
            before = inside
            squares[view, y, x] = wp.where(inside, since * since, -since * since)
        since = reach
        for step in range(1, width):
            x = width - 1 - step
            square = squares[view, y, x]
            since = wp.min(since + 1, reach)
            if (square > 0) != (squares[view, y, x + 1] > 0):
                since = 1
            if since * since < wp.abs(square):
                squares[view, y, x] = wp.where(square > 0, since * since, -since * since)

    @wp.kernel(enable_backward=False)
    def _column_gap(squares: wp.array3d(dtype=int), reach: int, gap: wp.array3d(dtype=int)):
        # Rows to the nearest one, in this column, from which a square below reach² or the other kind can come.
        view, x = wp.tid()
        height = squares.shape[1]
        cap = reach * reach
        since = reach
        before = squares[view, 0, x]
        for y in range(height):
            square = squares[view, y, x]
            since = wp.min(since + 1, reach)
            if wp.abs(square) < cap:
                since = 0
            if (square > 0) != (before > 0):
                since = 0
                gap[view, y - 1, x] = 0
            before = square
            gap[view, y, x] = since
        since = reach
        for step in range(height):
            y = height - 1 - step
            since = wp.min(since + 1, gap[view, y, x])
            gap[view, y, x] = since

    @wp.kernel(enable_backward=False)
    def _signed_distance(
        squares: wp.array3d(dtype=int), gap: wp.array3d(dtype=int), reach: int, distance: wp.array3d(dtype=float)
    ):
        view, y, x = wp.tid()
        height = squares.shape[1]
        sign = wp.where(squares[view, y, x] > 0, 1, -1)
        best = wp.abs(squares[view, y, x])
        # Another row's pixel of the other kind is itself the nearest of its row: its square counts as zero.
        for k in range(wp.max(gap[view, y, x], 1), reach):
            if k * k >= best:
                break
            if y - k >= 0:
                best = wp.min(best, k * k + wp.max(sign * squares[view, y - k, x], 0))
            if y + k < height:
                best = wp.min(best, k * k + wp.max(sign * squares[view, y + k, x], 0))
        # Half a pixel each way: the outline runs between the pixels.
        distance[view, y, x] = float(sign) * (wp.sqrt(float(best)) - 0.5)

    @wp.kernel(enable_backward=False)
    def _outside(shown: wp.array3d(dtype=float), distance: wp.array3d(dtype=float)):
        # Of pixels where even what is not known is no object: the distance to what is seen of it.
        view, y, x = wp.tid()
        if distance[view, y, x] < 0.0:
            distance[view, y, x] = shown[view, y, x]

    @wp.func
    def _least_distance(
        point: wp.vec3,
        distance: wp.array3d(dtype=float),
        known: wp.array3d(dtype=wp.bool),
        cam_from_world: wp.array(dtype=mat34),
        K: wp.array(dtype=wp.mat33),
        enough: float,
        least_views: int,
    ) -> float:
        least = float(wp.inf)
        views = wp.int32(0)
        for view in range(distance.shape[0]):
            if least > enough:
                seen = pixel_and_depth(point, cam_from_world[view], K[view])
                if known_at(known, view, seen[0], seen[1]):
                    metres = sample_at(distance, view, seen[0], seen[1]) * seen[2] / K[view][0, 0]
                    least = wp.min(least, metres)
                    views += 1
        if known.shape[0] > 0:
            # At an image's border the distance jumps: cut off, it is the same however many views were asked.
            if views < least_views:
                return enough
            return wp.max(least, enough)
        return least

    @wp.kernel(enable_backward=False)
    def _coarse(
        distance: wp.array3d(dtype=float),
        known: wp.array3d(dtype=wp.bool),
        cam_from_world: wp.array(dtype=mat34),
        K: wp.array(dtype=wp.mat33),
        cell: float,
        shift: float,
        enough: float,
        least_views: int,
        field: wp.array3d(dtype=float),
        near: wp.array3d(dtype=wp.bool),
    ):
        i, j, k = wp.tid()
        point = centre(i, j, k, 2.0 * cell, near.shape[0])
        value = _least_distance(point, distance, known, cam_from_world, K, enough, least_views)
        near[i, j, k] = wp.abs(value) < 1.45 * (2.0 * cell)
        for corner in range(8):
            field[2 * i + corner // 4, 2 * j + (corner // 2) % 2, 2 * k + corner % 2] = value + shift

    @wp.kernel(enable_backward=False)
    def _fine(
        distance: wp.array3d(dtype=float),
        known: wp.array3d(dtype=wp.bool),
        cam_from_world: wp.array(dtype=mat34),
        K: wp.array(dtype=wp.mat33),
        cell: float,
        shift: float,
        enough: float,
        least_views: int,
        chosen: wp.array(dtype=int),
        field: wp.array3d(dtype=float),
    ):
        at, corner = wp.tid()
        grid = field.shape[0]
        half = grid // 2
        i = 2 * (chosen[at] // (half * half)) + corner // 4
        j = 2 * ((chosen[at] // half) % half) + (corner // 2) % 2
        k = 2 * (chosen[at] % half) + corner % 2
        point = centre(i, j, k, cell, grid)
        field[i, j, k] = _least_distance(point, distance, known, cam_from_world, K, enough, least_views) + shift

    @wp.kernel(enable_backward=False)
    def _near(
        field: wp.array3d(dtype=float), cell: float, chosen: wp.array(dtype=int), near: wp.array3d(dtype=wp.bool)
    ):
        at, corner = wp.tid()
        half = field.shape[0] // 2
        i = 2 * (chosen[at] // (half * half)) + corner // 4
        j = 2 * ((chosen[at] // half) % half) + (corner // 2) % 2
        k = 2 * (chosen[at] % half) + corner % 2
        value = wp.abs(field[i, j, k])
        if value < 0.87 * cell:
            g = gradient(field, i, j, k, cell)
            steep = g[0] * g[0] + g[1] * g[1] + g[2] * g[2]
            near[i, j, k] = steep > 0.01 and value < 0.87 * cell * wp.sqrt(steep)

    return FieldKernels(_row_distance, _column_gap, _signed_distance, _outside, _coarse, _fine, _near)
