"""Warp kernels of the splatter: tile lists and blending, forward and backward; one source for CPU and CUDA.

No `from __future__ import annotations` here: Warp reads the annotations of closures, which must be types, not strings.
"""

import functools
from typing import NamedTuple, no_type_check

import warp as wp

from kernels.splat_projection import ALPHA_MIN, TILE

PIXELS = TILE * TILE
RECORD = 8
"""u, v, A, B, C, opacity, lowest power that can be visible, depth."""
GRADIENT = 10
"""Gradients of u, v, A, B, C, opacity, depth, red, green, blue."""


class Listing(NamedTuple):
    """Kernels that build the tile lists."""

    count: wp.Kernel
    identity: wp.Kernel
    permute: wp.Kernel
    emit: wp.Kernel
    gather: wp.Kernel
    starts: wp.Kernel


class Blending(NamedTuple):
    """Kernels that blend, for one float type."""

    forward: wp.Kernel
    backward: wp.Kernel
    reduce: wp.Kernel


@no_type_check  # Warp compiles these from their source; a run-time checker around them would hide it
@functools.cache
def listing_kernels() -> Listing:
    """Kernels that build tile lists; independent of the float type."""

    @wp.kernel(module="unique", enable_backward=False)
    def count(rectangles: wp.array(dtype=wp.vec4i), counts: wp.array(dtype=wp.int32), total: wp.array(dtype=wp.int64)):
        i = wp.tid()
        r = rectangles[i]
        n = (r[2] - r[0]) * (r[3] - r[1])
        counts[i] = n
        if n > 0:
            wp.atomic_add(total, 0, wp.int64(n))

    @wp.kernel(module="unique", enable_backward=False)
    def identity(order: wp.array(dtype=wp.int32)):
        i = wp.tid()
        order[i] = i

    @wp.kernel(module="unique", enable_backward=False)
    def permute(values: wp.array(dtype=wp.int32), order: wp.array(dtype=wp.int32), out: wp.array(dtype=wp.int32)):
        i = wp.tid()
        out[i] = values[order[i]]

    @wp.kernel(module="unique", enable_backward=False)
    def emit(
        rectangles: wp.array(dtype=wp.vec4i),
        order: wp.array(dtype=wp.int32),
        offsets: wp.array(dtype=wp.int32),
        per_image: int,
        tiles_across: int,
        tiles_per_image: int,
        keys: wp.array(dtype=wp.int32),
        slots: wp.array(dtype=wp.int32),
        owners: wp.array(dtype=wp.int32),
    ):
        i = wp.tid()
        gaussian = order[i]
        r = rectangles[gaussian]
        first = (gaussian // per_image) * tiles_per_image
        slot = offsets[i]
        for y in range(r[1], r[3]):
            for x in range(r[0], r[2]):
                keys[slot] = first + y * tiles_across + x
                slots[slot] = slot
                owners[slot] = gaussian
                slot += 1

    @wp.kernel(module="unique", enable_backward=False)
    def gather(
        slots: wp.array(dtype=wp.int32),
        owners: wp.array(dtype=wp.int32),
        listed: wp.array(dtype=wp.int32),
        places: wp.array(dtype=wp.int32),
    ):
        place = wp.tid()
        listed[place] = owners[slots[place]]
        places[slots[place]] = place

    @wp.kernel(module="unique", enable_backward=False)
    def starts(keys: wp.array(dtype=wp.int32), pairs: int, out: wp.array(dtype=wp.int32)):
        # First place whose tile is at least this one; the element after the last tile is the number of pairs.
        tile = wp.tid()
        low = wp.int32(0)
        high = wp.int32(pairs)
        while low < high:
            middle = low + (high - low) // 2
            if keys[middle] < tile:
                low = middle + 1
            else:
                high = middle
        out[tile] = low

    return Listing(count, identity, permute, emit, gather, starts)


@no_type_check
@functools.cache
def blending_kernels(real: type) -> Blending:
    """Kernels that blend in `wp.float32` or `wp.float64`: (forward, backward, reduce)."""
    record = wp.types.vector(length=RECORD, dtype=real)
    gradient = wp.types.vector(length=GRADIENT, dtype=real)
    vec3 = wp.types.vector(length=3, dtype=real)
    half = wp.constant(real(0.5))
    one = wp.constant(real(1.0))
    zero = wp.constant(real(0.0))
    visible = wp.constant(real(ALPHA_MIN))
    tile_edge = wp.constant(TILE)

    @wp.kernel(module="unique", enable_backward=False)
    def forward(
        first: int,
        width: int,
        height: int,
        alpha_max: real,
        stop: real,
        starts: wp.array(dtype=wp.int32),
        listed: wp.array(dtype=wp.int32),
        records: wp.array(dtype=record),
        colours: wp.array(dtype=vec3),
        backgrounds: wp.array(dtype=vec3),
        image: wp.array(dtype=vec3),
        depths: wp.array(dtype=real),
        final: wp.array(dtype=real),
        last: wp.array(dtype=wp.int32),
    ):
        offset, pixel = wp.tid()
        tile = first + offset
        across = (width + tile_edge - 1) // tile_edge
        per_image = across * ((height + tile_edge - 1) // tile_edge)
        view = tile // per_image
        column = (tile % per_image) % across * tile_edge + pixel % tile_edge
        row = (tile % per_image) // across * tile_edge + pixel // tile_edge
        if column < width and row < height:
            u = real(column) + half
            v = real(row) + half
            t = real(1.0)
            rgb = vec3()
            z = real(0.0)
            begin = starts[tile]
            end = starts[tile + 1]
            used = wp.int32(0)
            place = wp.int32(begin)
            while place < end:
                r = records[listed[place]]
                dx = r[0] - u
                dy = r[1] - v
                power = -half * (r[2] * dx * dx + r[4] * dy * dy) - r[3] * dx * dy
                place += 1
                if power <= zero and power >= r[6]:
                    alpha = r[5] * wp.exp(power)
                    if alpha >= visible:
                        alpha = wp.min(alpha, alpha_max)
                        left = t * (one - alpha)
                        if left < stop:
                            place = end
                        else:
                            weight = alpha * t
                            rgb += weight * colours[listed[place - 1]]
                            z += weight * r[7]
                            t = left
                            used = place - begin
            where = (view * height + row) * width + column
            image[where] = rgb + t * backgrounds[view]
            depths[where] = z
            final[where] = t
            last[where] = used

    @wp.kernel(module="unique", enable_backward=False)
    def backward(
        first: int,
        width: int,
        height: int,
        alpha_max: real,
        starts: wp.array(dtype=wp.int32),
        listed: wp.array(dtype=wp.int32),
        records: wp.array(dtype=record),
        colours: wp.array(dtype=vec3),
        final: wp.array(dtype=real),
        last: wp.array(dtype=wp.int32),
        image_gradient: wp.array(dtype=vec3),
        depth_gradient: wp.array(dtype=real),
        final_gradient: wp.array(dtype=real),
        gradients: wp.array(dtype=gradient),
    ):
        # Back to front. With F_i = g·(colour_i, depth_i) and S_i the blended sum of F behind i:
        # dL/dalpha_i = T_i F_i - (S_i + T_final dL/dT_final) / (1 - alpha_i).
        offset, pixel = wp.tid()
        tile = first + offset
        across = (width + tile_edge - 1) // tile_edge
        per_image = across * ((height + tile_edge - 1) // tile_edge)
        view = tile // per_image
        column = (tile % per_image) % across * tile_edge + pixel % tile_edge
        row = (tile % per_image) // across * tile_edge + pixel // tile_edge
        if column < width and row < height:
            where = (view * height + row) * width + column
            u = real(column) + half
            v = real(row) + half
            g_rgb = image_gradient[where]
            g_z = depth_gradient[where]
            t = final[where]
            behind = t * final_gradient[where]
            begin = starts[tile]
            place = begin + last[where]
            while place > begin:
                place -= 1
                gaussian = listed[place]
                r = records[gaussian]
                dx = r[0] - u
                dy = r[1] - v
                power = -half * (r[2] * dx * dx + r[4] * dy * dy) - r[3] * dx * dy
                if power <= zero and power >= r[6]:
                    falloff = wp.exp(power)
                    raw = r[5] * falloff
                    if raw >= visible:
                        alpha = wp.min(raw, alpha_max)
                        inverse = one / (one - alpha)
                        t = t * inverse
                        weight = alpha * t
                        feature = wp.dot(g_rgb, colours[gaussian]) + g_z * r[7]
                        g_alpha = t * feature - behind * inverse
                        behind += weight * feature
                        g = gradient()
                        if raw <= alpha_max:
                            g_power = raw * g_alpha
                            g[0] = -g_power * (r[2] * dx + r[3] * dy)
                            g[1] = -g_power * (r[4] * dy + r[3] * dx)
                            g[2] = -half * g_power * dx * dx
                            g[3] = -g_power * dx * dy
                            g[4] = -half * g_power * dy * dy
                            g[5] = falloff * g_alpha
                        g[6] = weight * g_z
                        g[7] = weight * g_rgb[0]
                        g[8] = weight * g_rgb[1]
                        g[9] = weight * g_rgb[2]
                        wp.atomic_add(gradients, place, g)

    @wp.kernel(module="unique", enable_backward=False)
    def reduce(
        order: wp.array(dtype=wp.int32),
        counts: wp.array(dtype=wp.int32),
        offsets: wp.array(dtype=wp.int32),
        places: wp.array(dtype=wp.int32),
        gradients: wp.array(dtype=gradient),
        out: wp.array(dtype=gradient),
    ):
        # A Gaussian's slots are contiguous, so its sum has one owner and one order: reproducible without atomics.
        i = wp.tid()
        total = gradient()
        for k in range(counts[i]):
            total += gradients[places[offsets[i] + k]]
        out[order[i]] = total

    return Blending(forward, backward, reduce)
