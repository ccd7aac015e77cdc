"""Which pixels a triangle mesh can touch, and which of them one of its silhouette edges crosses (NVIDIA Warp).

A pixel that the mesh touches and no silhouette edge crosses is covered wholly by it, because the sheet in front can
only end at an edge between a face that looks at the camera and one that does not, or at a border. So only the others
need more than one ray for exact coverage. The test is conservative: it may name a pixel too many, never one too few.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, no_type_check

import numpy as np
import warp as wp

TOUCHED, CROSSED = 1, 2


def neighbours(faces: np.ndarray) -> np.ndarray:
    """Face on the other side of each edge (corner i to i+1).

    -1 at a border, where more than two faces meet, and where two faces disagree about their outer side.
    """
    start, end = faces, np.roll(faces, -1, axis=1)
    low, high = np.minimum(start, end).ravel().astype(np.int64), np.maximum(start, end).ravel().astype(np.int64)
    key = low * (int(faces.max(initial=0)) + 1) + high
    order = np.argsort(key, kind="stable")
    ranked = key[order]
    _, first, count = np.unique(ranked, return_index=True, return_counts=True)
    pair = first[count == 2]
    pair = pair[start.ravel()[order[pair]] == end.ravel()[order[pair + 1]]]
    result = np.full(len(key), -1, np.int32)
    result[order[pair]], result[order[pair + 1]] = order[pair + 1] // 3, order[pair] // 3
    return result.reshape(-1, 3)


@no_type_check  # Warp compiles the kernel from its source; a run-time checker around it would hide it
@lru_cache(maxsize=1)
def footprint_kernel() -> Any:
    """Kernel over faces that raises the marks of a window's pixels to TOUCHED or CROSSED."""

    @wp.func
    def _facing(points: wp.array(dtype=wp.vec3), indices: wp.array(dtype=int), face: int, centre: wp.vec3) -> float:
        a = points[indices[3 * face]]
        normal = wp.cross(points[indices[3 * face + 1]] - a, points[indices[3 * face + 2]] - a)
        return wp.dot(normal, centre - a)

    @wp.func
    def _overlap(a: wp.vec2, b: wp.vec2, middle: wp.vec2, side: float) -> float:
        # Signed distance of the pixel's nearest corner to the line a-b, positive inside, times the edge's length.
        edge = b - a
        reach = 0.51 * (wp.abs(edge[0]) + wp.abs(edge[1]))
        return side * (edge[0] * (middle[1] - a[1]) - edge[1] * (middle[0] - a[0])) + reach

    @wp.func
    def _cross(
        marks: wp.array2d(dtype=int), a: wp.vec2, b: wp.vec2, corner: wp.vec2i, width: int, height: int, value: int
    ):
        x0 = wp.max(int(wp.floor(wp.min(a[0], b[0]) - 0.01)) - corner[0], 0)
        y0 = wp.max(int(wp.floor(wp.min(a[1], b[1]) - 0.01)) - corner[1], 0)
        x1 = wp.min(int(wp.floor(wp.max(a[0], b[0]) + 0.01)) - corner[0], width - 1)
        y1 = wp.min(int(wp.floor(wp.max(a[1], b[1]) + 0.01)) - corner[1], height - 1)
        for y in range(y0, y1 + 1):
            for x in range(x0, x1 + 1):
                middle = wp.vec2(float(corner[0] + x) + 0.5, float(corner[1] + y) + 0.5)
                if _overlap(a, b, middle, 1.0) >= 0.0 and _overlap(a, b, middle, -1.0) >= 0.0:
                    wp.atomic_max(marks, y, x, value)

    @wp.kernel
    def _mark(
        points: wp.array(dtype=wp.vec3),
        indices: wp.array(dtype=int),
        neighbour: wp.array(dtype=int),
        rotation: wp.mat33,
        centre: wp.vec3,
        focal: wp.vec2,
        principal: wp.vec2,
        corner: wp.vec2i,
        marks: wp.array2d(dtype=int),
    ):
        face = wp.tid()
        height = marks.shape[0]
        width = marks.shape[1]
        turned = wp.transpose(rotation)
        la = turned * (points[indices[3 * face]] - centre)
        lb = turned * (points[indices[3 * face + 1]] - centre)
        lc = turned * (points[indices[3 * face + 2]] - centre)
        a = wp.vec2(focal[0] * la[0] / la[2] + principal[0], focal[1] * la[1] / la[2] + principal[1])
        b = wp.vec2(focal[0] * lb[0] / lb[2] + principal[0], focal[1] * lb[1] / lb[2] + principal[1])
        c = wp.vec2(focal[0] * lc[0] / lc[2] + principal[0], focal[1] * lc[1] / lc[2] + principal[1])
        x0 = wp.max(int(wp.floor(wp.min(wp.min(a[0], b[0]), c[0]) - 0.01)) - corner[0], 0)
        y0 = wp.max(int(wp.floor(wp.min(wp.min(a[1], b[1]), c[1]) - 0.01)) - corner[1], 0)
        x1 = wp.min(int(wp.floor(wp.max(wp.max(a[0], b[0]), c[0]) + 0.01)) - corner[0], width - 1)
        y1 = wp.min(int(wp.floor(wp.max(wp.max(a[1], b[1]), c[1]) + 0.01)) - corner[1], height - 1)
        side = wp.sign((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
        for y in range(y0, y1 + 1):
            for x in range(x0, x1 + 1):
                middle = wp.vec2(float(corner[0] + x) + 0.5, float(corner[1] + y) + 0.5)
                inside = wp.min(_overlap(a, b, middle, side), _overlap(b, c, middle, side))
                if wp.min(inside, _overlap(c, a, middle, side)) >= 0.0:
                    wp.atomic_max(marks, y, x, 1)
        facing = _facing(points, indices, face, centre)
        for i in range(3):
            other = neighbour[3 * face + i]
            silhouette = bool(other < 0)
            if other > face:
                silhouette = facing * _facing(points, indices, other, centre) <= 0.0
            if silhouette:
                start = a
                end = b
                if i == 1:
                    start = b
                    end = c
                if i == 2:
                    start = c
                    end = a
                _cross(marks, start, end, corner, width, height, 2)

    return _mark
