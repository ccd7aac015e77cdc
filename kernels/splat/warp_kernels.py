"""Warp kernels of the splatter: tile lists and blending, forward and backward; one source for CPU and CUDA.

No `from __future__ import annotations` here: Warp reads the annotations of closures, which must be types, not strings.
"""

import functools
from typing import NamedTuple, no_type_check

import warp as wp

from kernels.splat.projection import ALPHA_MIN, TILE

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
def blending_kernels(real: type, strip: int) -> Blending:
    """Kernels that blend in `wp.float32` or `wp.float64`, a thread for `strip` neighbouring pixels of one tile row.

    A CPU takes whole rows: what a row shares is computed once, and the pixels of the row that a Gaussian reaches are
    solved for instead of being searched. A GPU takes single pixels, whose state then lives in registers.
    """
    record = wp.types.vector(length=RECORD, dtype=real)
    gradient = wp.types.vector(length=GRADIENT, dtype=real)
    vec3 = wp.types.vector(length=3, dtype=real)
    colour_strip = wp.types.matrix(shape=(strip, 3), dtype=real)
    real_strip = wp.types.vector(length=strip, dtype=real)
    count_strip = wp.types.vector(length=strip, dtype=wp.int32)
    half = wp.constant(real(0.5))
    one = wp.constant(real(1.0))
    zero = wp.constant(real(0.0))
    slack = wp.constant(real(1e-5))
    visible = wp.constant(real(ALPHA_MIN))
    edge = wp.constant(TILE)
    size = wp.constant(strip)
    in_row = wp.constant(TILE // strip)

    @wp.func
    def strip_origin(tile: int, part: int, width: int, height: int):
        # (image, row, first column) of a strip.
        across = (width + edge - 1) // edge
        per_image = across * ((height + edge - 1) // edge)
        inside = tile % per_image
        row = inside // across * edge + part // in_row
        return tile // per_image, row, inside % across * edge + part % in_row * size

    @wp.func
    def visible_span(r: record, column: int, dy: real, columns: int):
        # Pixels [first, stop) of the strip where the power can reach its lowest visible value r[6]:
        # A dx² + 2 B dy dx + C dy² + 2 r[6] <= 0, a quadratic in dx; the slack covers its rounding.
        b = r[3] * dy
        square = b * b * (one + slack) - r[2] * (r[4] * dy * dy + r[6] + r[6])
        first = wp.int32(0)
        stop = wp.int32(0)
        if square >= zero:
            root = wp.sqrt(square)
            middle = r[0] - real(column) - half
            low = wp.max(middle + (b - root) / r[2] - slack, zero)
            high = wp.min(middle + (b + root) / r[2] + slack, real(columns - 1))
            if low <= high:
                first = wp.int32(wp.ceil(low))
                stop = wp.int32(wp.floor(high)) + 1
        return first, stop

    @wp.kernel(module="unique", enable_backward=False)
    def forward(
        tile_first: int,
        width: int,
        height: int,
        alpha_max: real,
        end_below: real,
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
        offset, part = wp.tid()
        tile = tile_first + offset
        view, row, column = strip_origin(tile, part, width, height)
        columns = wp.min(size, width - column)
        if columns > 0 and row < height:
            t = real_strip()
            z = real_strip()
            rgb = colour_strip()
            used = count_strip()
            ended = count_strip()
            for k in range(size):
                t[k] = one
            v = real(row) + half
            begin = starts[tile]
            end = starts[tile + 1]
            alive = wp.int32(columns)
            place = wp.int32(begin)
            while place < end and alive > 0:
                gaussian = listed[place]
                r = records[gaussian]
                place += 1
                dy = r[1] - v
                first, stop = visible_span(r, column, dy, columns)
                for k in range(first, stop):
                    if ended[k] == 0:
                        dx = r[0] - (real(column + k) + half)
                        power = -half * (r[2] * dx * dx + r[4] * dy * dy) - r[3] * dx * dy
                        alpha = r[5] * wp.exp(power)
                        if power <= zero and alpha >= visible:
                            alpha = wp.min(alpha, alpha_max)
                            left = t[k] * (one - alpha)
                            if left < end_below:
                                ended[k] = 1
                                alive -= 1
                            else:
                                weight = alpha * t[k]
                                colour = colours[gaussian]
                                rgb[k, 0] = rgb[k, 0] + weight * colour[0]
                                rgb[k, 1] = rgb[k, 1] + weight * colour[1]
                                rgb[k, 2] = rgb[k, 2] + weight * colour[2]
                                z[k] = z[k] + weight * r[7]
                                t[k] = left
                                used[k] = place - begin
            where = (view * height + row) * width + column
            for k in range(columns):
                image[where + k] = vec3(rgb[k, 0], rgb[k, 1], rgb[k, 2]) + t[k] * backgrounds[view]
                depths[where + k] = z[k]
                final[where + k] = t[k]
                last[where + k] = used[k]

    @wp.kernel(module="unique", enable_backward=False)
    def backward(
        tile_first: int,
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
        offset, part = wp.tid()
        tile = tile_first + offset
        view, row, column = strip_origin(tile, part, width, height)
        columns = wp.min(size, width - column)
        if columns > 0 and row < height:
            where = (view * height + row) * width + column
            t = real_strip()
            behind = real_strip()
            deepest = wp.int32(0)
            for k in range(columns):
                t[k] = final[where + k]
                behind[k] = t[k] * final_gradient[where + k]
                deepest = wp.max(deepest, last[where + k])
            v = real(row) + half
            begin = starts[tile]
            place = begin + deepest
            while place > begin:
                place -= 1
                gaussian = listed[place]
                r = records[gaussian]
                dy = r[1] - v
                first, stop = visible_span(r, column, dy, columns)
                if first < stop:
                    g = gradient()
                    colour = colours[gaussian]
                    for k in range(first, stop):
                        if place - begin < last[where + k]:
                            dx = r[0] - (real(column + k) + half)
                            power = -half * (r[2] * dx * dx + r[4] * dy * dy) - r[3] * dx * dy
                            falloff = wp.exp(power)
                            raw = r[5] * falloff
                            if power <= zero and raw >= visible:
                                g_rgb = image_gradient[where + k]
                                g_z = depth_gradient[where + k]
                                alpha = wp.min(raw, alpha_max)
                                inverse = one / (one - alpha)
                                t_here = t[k] * inverse
                                t[k] = t_here
                                weight = alpha * t_here
                                feature = wp.dot(g_rgb, colour) + g_z * r[7]
                                g_alpha = t_here * feature - behind[k] * inverse
                                behind[k] = behind[k] + weight * feature
                                if raw <= alpha_max:
                                    g_power = raw * g_alpha
                                    g[0] = g[0] - g_power * (r[2] * dx + r[3] * dy)
                                    g[1] = g[1] - g_power * (r[4] * dy + r[3] * dx)
                                    g[2] = g[2] - half * g_power * dx * dx
                                    g[3] = g[3] - g_power * dx * dy
                                    g[4] = g[4] - half * g_power * dy * dy
                                    g[5] = g[5] + falloff * g_alpha
                                g[6] = g[6] + weight * g_z
                                g[7] = g[7] + weight * g_rgb[0]
                                g[8] = g[8] + weight * g_rgb[1]
                                g[9] = g[9] + weight * g_rgb[2]
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
