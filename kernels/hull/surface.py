"""Gaussians of the cells that a hull's surface comes near (NVIDIA Warp).

The arithmetic, and its order, is that of `aerojax.reconstruct.hull`.
No `from __future__ import annotations` here: Warp reads the annotations of closures, which must be types, not strings.
"""

from functools import lru_cache
from typing import NamedTuple, no_type_check

import warp as wp

from kernels.hull.field import grid_functions, image_functions, mat34


class SurfaceKernels(NamedTuple):
    """`place`: position and normal; `axes`: orientation and size; `see`, then `colour`: what the views show there."""

    place: wp.Kernel
    axes: wp.Kernel
    see: wp.Kernel
    colour: wp.Kernel


@no_type_check  # Warp compiles functions from their source; a run-time checker around them would hide it
@lru_cache(maxsize=1)
def axes_functions():
    """Warp functions: moments of the surface about a point; quaternion (w, x, y, z; w ≥ 0) of a rotation."""
    centre, _ = grid_functions()

    @wp.func
    def moments_about(point: wp.vec3, field: wp.array3d(dtype=float), cell: float) -> wp.mat33:
        grid = field.shape[0]
        middle = float(grid - 1) / 2.0
        total = float(0.0)
        moments = wp.mat33(0.0)
        i0 = int(wp.rint(point[0] / cell + middle)) - 1
        j0 = int(wp.rint(point[1] / cell + middle)) - 1
        k0 = int(wp.rint(point[2] / cell + middle)) - 1
        inverse = 1.0 / (cell * cell)
        for n in range(27):
            i = wp.clamp(i0 + n // 9, 0, grid - 1)
            j = wp.clamp(j0 + (n // 3) % 3, 0, grid - 1)
            k = wp.clamp(k0 + n % 3, 0, grid - 1)
            off = field[i, j, k]
            delta = centre(i, j, k, cell, grid) - point
            weight = wp.exp(-inverse * (2.0 * off * off + 0.5 * wp.dot(delta, delta)))
            total += weight
            moments += wp.outer(weight * delta, delta)
        return moments / wp.max(total, 1.0e-6)

    @wp.func
    def quaternion_of(m: wp.mat33) -> wp.vec4:
        # Shepperd 1978: divide by the largest component; ties go to the first.
        xx = m[0, 0]
        yy = m[1, 1]
        zz = m[2, 2]
        squares = wp.vec4(1.0 + xx + yy + zz, 1.0 + xx - yy - zz, 1.0 - xx + yy - zz, 1.0 - xx - yy + zz)
        wx = m[2, 1] - m[1, 2]
        wy = m[0, 2] - m[2, 0]
        wz = m[1, 0] - m[0, 1]
        q = wp.vec4(squares[0], wx, wy, wz)
        best = squares[0]
        if squares[1] > best:
            best = squares[1]
            q = wp.vec4(wx, squares[1], m[1, 0] + m[0, 1], m[0, 2] + m[2, 0])
        if squares[2] > best:
            best = squares[2]
            q = wp.vec4(wy, m[1, 0] + m[0, 1], squares[2], m[2, 1] + m[1, 2])
        if squares[3] > best:
            q = wp.vec4(wz, m[0, 2] + m[2, 0], m[2, 1] + m[1, 2], squares[3])
        q = wp.normalize(q)
        if q[0] < 0.0:
            q = -q
        return q

    return moments_about, quaternion_of


@no_type_check
@lru_cache(maxsize=1)
def surface_kernels() -> SurfaceKernels:
    """All kernels of the surface, compiled at their first launch."""
    pixel_and_depth, sample_at, _, known_about = image_functions()
    centre, gradient = grid_functions()
    moments_about, quaternion_of = axes_functions()

    @wp.kernel(enable_backward=False)
    def _place(
        index: wp.array(dtype=int),
        field: wp.array3d(dtype=float),
        cell: float,
        points: wp.array(dtype=wp.vec3),
        normals: wp.array(dtype=wp.vec3),
    ):
        n = wp.tid()
        grid = field.shape[0]
        i = index[n] // (grid * grid)
        j = (index[n] // grid) % grid
        k = index[n] % grid
        g = gradient(field, i, j, k, cell)
        steep = g[0] * g[0] + g[1] * g[1] + g[2] * g[2]
        points[n] = centre(i, j, k, cell, grid) - field[i, j, k] / wp.max(steep, 0.01) * g
        normals[n] = -g / wp.sqrt(wp.max(steep, 1.0e-24))

    @wp.kernel(enable_backward=False)
    def _axes(
        points: wp.array(dtype=wp.vec3),
        normals: wp.array(dtype=wp.vec3),
        field: wp.array3d(dtype=float),
        cell: float,
        quaternions: wp.array(dtype=wp.vec4),
        scales: wp.array(dtype=wp.vec3),
    ):
        n = wp.tid()
        normal = normals[n]
        moments = moments_about(points[n], field, cell)
        helper = wp.vec3(0.0, 1.0, 0.0)
        if wp.abs(normal[0]) < 0.6:
            helper = wp.vec3(1.0, 0.0, 0.0)
        first = wp.normalize(wp.cross(normal, helper))
        second = wp.cross(normal, first)
        a = wp.dot(first, moments * first)
        b = wp.dot(first, moments * second)
        c = wp.dot(second, moments * second)
        angle = 0.5 * wp.atan2(2.0 * b, a - c + 1.0e-30)
        major = wp.cos(angle) * first + wp.sin(angle) * second
        minor = wp.cos(angle) * second - wp.sin(angle) * first
        third = wp.cross(major, minor)
        thinnest = 0.15 * cell * (0.15 * cell)
        scales[n] = wp.vec3(
            wp.sqrt(wp.max(wp.dot(major, moments * major), thinnest)),
            wp.sqrt(wp.max(wp.dot(minor, moments * minor), thinnest)),
            wp.sqrt(wp.max(0.1 * wp.dot(third, moments * third), thinnest)),
        )
        quaternions[n] = quaternion_of(wp.matrix_from_cols(major, minor, third))

    @wp.func
    def _bin(seen: wp.vec3, bins: int) -> int:
        x = int(wp.clamp(seen[0] / 2.0, 0.0, float(bins - 1)))
        y = int(wp.clamp(seen[1] / 2.0, 0.0, float(bins - 1)))
        return y * bins + x

    @wp.kernel(enable_backward=False)
    def _see(
        points: wp.array(dtype=wp.vec3),
        normals: wp.array(dtype=wp.vec3),
        beneath: float,
        cam_from_world: wp.array(dtype=mat34),
        K: wp.array(dtype=wp.mat33),
        bins: int,
        seen: wp.array2d(dtype=wp.vec3),
        nearest: wp.array2d(dtype=float),
    ):
        view, n = wp.tid()
        pixel = pixel_and_depth(points[n] - beneath * normals[n], cam_from_world[view], K[view])
        seen[view, n] = pixel
        wp.atomic_min(nearest, view, _bin(pixel, bins), pixel[2])  # a minimum: any order gives the same

    @wp.kernel(enable_backward=False)
    def _colour(
        rgb: wp.array3d(dtype=wp.vec3),
        distance: wp.array3d(dtype=float),
        known: wp.array3d(dtype=wp.bool),
        points: wp.array(dtype=wp.vec3),
        normals: wp.array(dtype=wp.vec3),
        beneath: float,
        centres: wp.array(dtype=wp.vec3),
        seen: wp.array2d(dtype=wp.vec3),
        nearest: wp.array2d(dtype=float),
        bins: int,
        cell: float,
        colours: wp.array(dtype=wp.vec3),
    ):
        n = wp.tid()
        colour = wp.vec3(0.0)
        total = float(0.0)
        for view in range(rgb.shape[0]):
            pixel = seen[view, n]
            if known_about(known, view, pixel[0], pixel[1]):
                weight = float(1.0e-6)
                if pixel[2] < nearest[view, _bin(pixel, bins)] + 2.0 * cell:
                    towards = wp.normalize(centres[view] - (points[n] - beneath * normals[n]))
                    facing = wp.max(wp.dot(normals[n], towards), 0.0)
                    # The rim mixes with the background.
                    inner = wp.clamp(sample_at(distance, view, pixel[0], pixel[1]) / 2.0, 0.0, 1.0)
                    weight += 1.0e-3 + facing * facing * inner
                colour += weight * sample_at(rgb, view, pixel[0], pixel[1])
                total += weight
        colours[n] = colour / wp.max(total, 1.0e-12)

    return SurfaceKernels(_place, _axes, _see, _colour)
