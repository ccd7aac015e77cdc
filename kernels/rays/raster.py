"""Rasterising of one mesh with a colour a face into a window of an image: coverage, mean colour and depth
(NVIDIA Warp).

For a small object whose triangles are about as many as its pixels this is some ten times as fast as rays, and finds
the same at the same samples. A visibility buffer of n×n samples a pixel is filled face by face, nearest face first,
and then each pixel counts and averages its own.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, no_type_check

import numpy as np
import warp as wp

_DEPTH_STEPS = float(2**30)
"""Distinguishable depths from the nearest to the farthest vertex."""


@no_type_check  # Warp compiles the kernels from their source; a run-time checker around them would hide it
@lru_cache(maxsize=1)
def _kernels() -> tuple[Any, Any]:
    """Kernels over faces that fill the buffer and over pixels that read it."""

    @wp.func
    def _edge(a: wp.vec3, b: wp.vec3, x: float, y: float) -> float:
        return (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])

    @wp.kernel
    def _fill(
        points: wp.array(dtype=wp.vec3),
        faces: wp.array(dtype=wp.vec3i),
        steps: float,
        buffer: wp.array2d(dtype=wp.int64),
    ):
        face = wp.tid()
        corners = faces[face]
        a = points[corners[0]]
        b = points[corners[1]]
        c = points[corners[2]]
        area = _edge(a, b, c[0], c[1])
        if area == 0.0:
            return
        x0 = wp.max(int(wp.ceil(wp.min(wp.min(a[0], b[0]), c[0]) - 0.5)), 0)
        y0 = wp.max(int(wp.ceil(wp.min(wp.min(a[1], b[1]), c[1]) - 0.5)), 0)
        x1 = wp.min(int(wp.floor(wp.max(wp.max(a[0], b[0]), c[0]) - 0.5)), buffer.shape[1] - 1)
        y1 = wp.min(int(wp.floor(wp.max(wp.max(a[1], b[1]), c[1]) - 0.5)), buffer.shape[0] - 1)
        inverse = 1.0 / area
        for y in range(y0, y1 + 1):
            for x in range(x0, x1 + 1):
                px = float(x) + 0.5
                py = float(y) + 0.5
                u = _edge(b, c, px, py) * inverse
                v = _edge(c, a, px, py) * inverse
                w = _edge(a, b, px, py) * inverse
                if u >= 0.0 and v >= 0.0 and w >= 0.0:
                    near = u * a[2] + v * b[2] + w * c[2]
                    key = (wp.int64(wp.clamp(near, 0.0, 1.0) * steps) << wp.int64(32)) | wp.int64(face + 1)
                    wp.atomic_max(buffer, y, x, key)

    @wp.kernel
    def _read(
        buffer: wp.array2d(dtype=wp.int64),
        colours: wp.array(dtype=wp.vec3),
        samples: int,
        steps: float,
        count_out: wp.array2d(dtype=int),
        colour_out: wp.array2d(dtype=wp.vec3),
        near_out: wp.array2d(dtype=float),
    ):
        y, x = wp.tid()
        total = wp.vec3(0.0, 0.0, 0.0)
        near = float(0.0)
        count = int(0)  # noqa: RUF046  Warp reads int(0) as a variable, 0 as a constant
        for i in range(samples):
            for j in range(samples):
                key = buffer[y * samples + i, x * samples + j]
                if key != wp.int64(0):
                    total += colours[int(key & wp.int64(0xFFFFFFFF)) - 1]
                    near += float(key >> wp.int64(32)) / steps
                    count += 1
        count_out[y, x] = count
        colour_out[y, x] = total / float(wp.max(count, 1))
        near_out[y, x] = near / float(wp.max(count, 1))

    return _fill, _read


def rasterise(
    points: np.ndarray,
    faces: np.ndarray,
    colours: np.ndarray,
    size: tuple[int, int],
    samples: int,
    *,
    device: str | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Coverage, colour and depth of a mesh in a window.

    Args:
        points: u and v in pixels from the window's top-left corner, and depth along the optical axis, all positive
            (vertex, 3).
        faces: vertex indices (face, 3); both sides are seen.
        colours: linear, of each face (face, 3).
        size: width and height of the window, pixels.
        samples: along each side of a pixel, at the middles of equal parts.
        device: a Warp device name; the default device if None.

    Returns:
        Share of each pixel that is covered (row, column); mean colour of what covers it, black where nothing does (row,
        column, 3); depth of what covers it, harmonic mean, 0 where nothing does (row, column).
    """
    (width, height), fill, read = size, *_kernels()
    inverse = 1.0 / points[:, 2]  # linear in the image, unlike the depth
    low, high = inverse.min(), inverse.max()
    near = (inverse - low) / max(high - low, 1e-30)
    placed = np.concatenate([points[:, :2] * samples, near[:, None]], axis=1).astype(np.float32)
    buffer = wp.zeros((height * samples, width * samples), dtype=wp.int64, device=device)
    corners = wp.array(np.ascontiguousarray(faces, np.int32), dtype=wp.vec3i, device=device)
    inputs = [wp.array(placed, dtype=wp.vec3, device=device), corners, _DEPTH_STEPS]
    wp.launch(fill, dim=len(faces), inputs=inputs, outputs=[buffer], device=device)
    count = wp.empty((height, width), dtype=wp.int32, device=device)
    colour = wp.empty((height, width), dtype=wp.vec3, device=device)
    shade = wp.array(np.ascontiguousarray(colours, np.float32), dtype=wp.vec3, device=device)
    middle = wp.empty((height, width), dtype=wp.float32, device=device)
    inputs = [buffer, shade, samples, _DEPTH_STEPS]
    wp.launch(read, dim=(height, width), inputs=inputs, outputs=[count, colour, middle], device=device)
    counted = count.numpy().astype(np.float32)
    depth = np.where(counted > 0, 1.0 / (low + middle.numpy() * max(high - low, 1e-30)), 0.0).astype(np.float32)
    return counted / np.float32(samples * samples), colour.numpy(), depth
