"""The splatter's two Warp callables: build tile lists, then blend (forward) or differentiate the blend (backward).

The lists live only inside a call: a counting pass sizes them exactly, so no pair is ever dropped, and the backward pass
builds them again, so no array with a data-dependent size reaches JAX.
No `from __future__ import annotations` here: Warp reads the annotations of closures, which must be types, not strings.
"""

import contextlib
import functools
import itertools
import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple, no_type_check

import numpy as np
import warp as wp

from kernels.splat.projection import TILE
from kernels.splat.warp_kernels import GRADIENT, RECORD, Blending, blending_kernels, listing_kernels

MAX_PAIRS = 2**31 - 1
"""Places in a list are 32-bit; the sort's double buffer would take 34 GB there."""
CHUNKS_PER_THREAD = 4
"""Tile ranges a thread takes one after another: evens out pixels that end early, for some 20 µs a launch."""
FEW_PAIRS = 20_000
"""Pairs (Gaussian, tile) below which one chunk a thread is enough."""


class _Workers:
    """The thread pool that every CPU call shares; a launch releases the interpreter lock."""

    def __init__(self):
        self.count = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
        self._pools: dict[tuple[int, int], ThreadPoolExecutor] = {}

    def run(self, function: Any, ranges: list[tuple[int, int]]) -> None:
        """Call `function(first, stop)` for every range; an error in any of them is raised here."""
        if self.count == 1 or len(ranges) == 1:
            for first, stop in ranges:
                function(first, stop)
            return
        key = (os.getpid(), self.count)  # threads do not survive a fork
        pool = self._pools.setdefault(key, ThreadPoolExecutor(self.count, thread_name_prefix="splat"))
        for future in [pool.submit(function, first, stop) for first, stop in ranges]:
            future.result()


_WORKERS = _Workers()


@contextlib.contextmanager
def worker_threads(count: int) -> Iterator[None]:
    """Use `count` CPU threads inside the block (default: all cores of this process); results do not depend on it."""
    before, _WORKERS.count = _WORKERS.count, count
    try:
        yield
    finally:
        _WORKERS.count = before


class Lists(NamedTuple):
    """Gaussians by tile, front to back.

    order: all Gaussians by depth, ties by index. counts, offsets: tiles of the i-th of them, and its first slot.
    listed: Gaussian at every place, tile after tile. places: place of every slot. starts: first place of every tile.
    """

    order: wp.array
    counts: wp.array
    offsets: wp.array
    listed: wp.array
    places: wp.array
    starts: wp.array
    tiles: int


def _sort(keys: wp.array, values: wp.array, count: int, bits: int) -> None:
    """Stable radix sort of the first half of two double-sized arrays."""
    if count > 1:
        wp.utils.radix_sort_pairs(keys, values, count, end_bit=bits)


def pair_count_error(total: int) -> str:
    """The message for more pairs than a list can hold; it names the number needed."""
    return (
        f"splat: {total:,} Gaussian-tile pairs are needed, but a list holds at most {MAX_PAIRS:,}; "
        "draw fewer images a call, fewer or smaller Gaussians, or a smaller image"
    )


def build_lists(rectangles: wp.array, depths: wp.array, images: int, width: int, height: int) -> Lists:
    """Bin splats into tiles: a stable radix sort on (tile, depth), ties in index order.

    Least significant digit first: Gaussians are sorted by depth before they are expanded to pairs, and the pairs by
    tile after; the depth passes so run over Gaussians, not over the several times as many pairs.

    Raises:
        RuntimeError: if there are more than 2³¹-1 pairs; the message names the number.
    """
    kernels, device, n = listing_kernels(), rectangles.device, rectangles.shape[0]
    across, down = -(-width // TILE), -(-height // TILE)
    tiles = images * across * down

    def integers(size: int) -> wp.array:
        return wp.empty(max(size, 1), dtype=wp.int32, device=device)

    def launch(kernel: wp.Kernel, size: int, *arguments: Any) -> None:
        wp.launch(kernel, dim=size, inputs=arguments, device=device)

    counts, total = integers(n), wp.zeros(1, dtype=wp.int64, device=device)
    launch(kernels.count, n, rectangles, counts, total)
    pairs = int(total.numpy()[0])
    if pairs > MAX_PAIRS:
        raise RuntimeError(pair_count_error(pairs))

    keys, order = wp.empty(2 * n, dtype=depths.dtype, device=device), integers(2 * n)
    wp.copy(keys, depths, count=n)
    launch(kernels.identity, n, order)
    _sort(keys, order, n, 8 * wp.types.type_size_in_bytes(depths.dtype))
    sorted_counts, offsets = integers(n), integers(n)
    launch(kernels.permute, n, counts, order, sorted_counts)
    wp.utils.array_scan(sorted_counts, offsets, inclusive=False)

    keys, slots, owners = integers(2 * pairs), integers(2 * pairs), integers(pairs)
    launch(kernels.emit, n, rectangles, order, offsets, n // images, across, across * down, keys, slots, owners)
    _sort(keys, slots, pairs, tiles.bit_length())
    listed, places, starts = integers(pairs), integers(pairs), integers(tiles + 1)
    launch(kernels.gather, pairs, slots, owners, listed, places)
    launch(kernels.starts, tiles + 1, keys, pairs, starts)
    return Lists(order, sorted_counts, offsets, listed, places, starts, tiles)


def _ranges(lists: Lists, device: Any) -> list[tuple[int, int]]:
    """Tile ranges of about equal work: one on a GPU, a few for every thread on a CPU."""
    if device.is_cuda:
        return [(0, lists.tiles)]
    work = lists.starts.numpy() + np.arange(lists.tiles + 1)  # a tile without Gaussians still has pixels to write
    wanted = _WORKERS.count * (CHUNKS_PER_THREAD if work[-1] > FEW_PAIRS else 1)
    edges = np.searchsorted(work, work[-1] * np.arange(1, wanted) / wanted)
    edges = np.unique(np.concatenate([[0], edges, [lists.tiles]])).tolist()
    return list(itertools.pairwise(edges))


def _kernels(real: type, device: Any) -> tuple[Blending, int]:
    """Blending kernels for a device and how many strips of pixels a tile has for them."""
    strip = 1 if device.is_cuda else TILE
    return blending_kernels(real, strip), TILE * TILE // strip


def _launch_tiles(kernel: wp.Kernel, lists: Lists, strips: int, *arguments: Any) -> None:
    """Launch a blending kernel over all tiles, a thread a strip, tile ranges spread over the CPU's cores."""
    device: Any = lists.starts.device
    if device.is_cpu:
        wp.load_module(kernel.module, device, block_dim=1)  # before the pool: two threads must not compile one module

    def part(first: int, stop: int) -> None:
        wp.launch(kernel, dim=(stop - first, strips), inputs=[first, *arguments], device=device)

    _WORKERS.run(part, _ranges(lists, device))


@no_type_check  # Warp reads the annotations
@functools.cache
def callables(real: type) -> tuple[Any, Any]:
    """JAX callables (forward, backward) in `wp.float32` or `wp.float64`.

    Arrays are flat: Gaussians image after image, pixels row after row, image after image. Every output is overwritten.
    """
    record = wp.types.vector(length=RECORD, dtype=real)
    gradient = wp.types.vector(length=GRADIENT, dtype=real)
    vec3 = wp.types.vector(length=3, dtype=real)

    def splat_forward(
        records: wp.array(dtype=record),
        colours: wp.array(dtype=vec3),
        depths: wp.array(dtype=real),
        rectangles: wp.array(dtype=wp.vec4i),
        backgrounds: wp.array(dtype=vec3),
        width: int,
        height: int,
        alpha_max: float,
        stop: float,
        image: wp.array(dtype=vec3),
        depth: wp.array(dtype=real),
        final: wp.array(dtype=real),
        last: wp.array(dtype=wp.int32),
    ):
        lists = build_lists(rectangles, depths, backgrounds.shape[0], width, height)
        inputs = (width, height, alpha_max, stop, lists.starts, lists.listed, records, colours, backgrounds)
        kernels, strips = _kernels(real, records.device)
        _launch_tiles(kernels.forward, lists, strips, *inputs, image, depth, final, last)

    def splat_backward(
        records: wp.array(dtype=record),
        colours: wp.array(dtype=vec3),
        depths: wp.array(dtype=real),
        rectangles: wp.array(dtype=wp.vec4i),
        final: wp.array(dtype=real),
        last: wp.array(dtype=wp.int32),
        image_gradient: wp.array(dtype=vec3),
        depth_gradient: wp.array(dtype=real),
        final_gradient: wp.array(dtype=real),
        images: int,
        width: int,
        height: int,
        alpha_max: float,
        out: wp.array(dtype=gradient),
    ):
        lists = build_lists(rectangles, depths, images, width, height)
        gradients = wp.zeros(lists.listed.shape[0], dtype=gradient, device=records.device)
        inputs = (width, height, alpha_max, lists.starts, lists.listed, records, colours, final, last)
        pixels = (image_gradient, depth_gradient, final_gradient)
        kernels, strips = _kernels(real, records.device)
        _launch_tiles(kernels.backward, lists, strips, *inputs, *pixels, gradients)
        arguments = [lists.order, lists.counts, lists.offsets, lists.places, gradients, out]
        wp.launch(kernels.reduce, dim=records.shape[0], inputs=arguments, device=records.device)

    # The pair count is read on the host, which CUDA graph capture does not allow.
    settings = {"graph_mode": wp.JaxCallableGraphMode.NONE, "vmap_method": "sequential"}
    return wp.jax_callable(splat_forward, num_outputs=4, **settings), wp.jax_callable(splat_backward, **settings)
