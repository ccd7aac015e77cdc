"""Ray casting of one triangle mesh into a window of a pinhole image: colour, coverage and depth (NVIDIA Warp).

One thread a pixel. Coverage and colour average `samples`² rays on a regular sub-pixel grid; depth belongs to the ray
through the pixel's centre and is 0 where that ray misses. Everything is in one frame whose origin lies near the mesh,
so that float32 keeps sub-millimetre depth from kilometres away.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, no_type_check

import numpy as np
import warp as wp

from kernels.raytrace import Lighting


@dataclass(frozen=True)
class Window:
    """What one camera sees: linear colour of the covered part, coverage 0..1, depth in metres (0 = none)."""

    colour: np.ndarray
    coverage: np.ndarray
    depth: np.ndarray


@no_type_check  # Warp compiles the kernel from its source; a run-time checker around it would hide it
@lru_cache(maxsize=1)
def _cast_kernel() -> Any:
    @wp.func
    def _direction(rotation: wp.mat33, inverse_focal: wp.vec2, principal: wp.vec2, u: float, v: float) -> wp.vec3:
        local = wp.vec3((u - principal[0]) * inverse_focal[0], (v - principal[1]) * inverse_focal[1], 1.0)
        return rotation * local

    @wp.kernel
    def _cast(
        mesh: wp.uint64,
        albedo: wp.array(dtype=wp.vec3),
        rotation: wp.mat33,
        centre: wp.vec3,
        inverse_focal: wp.vec2,
        principal: wp.vec2,
        corner: wp.vec2i,
        width: int,
        samples: int,
        to_sun: wp.vec3,
        strength: wp.vec3,
        colour_out: wp.array(dtype=wp.vec3),
        coverage_out: wp.array(dtype=float),
        depth_out: wp.array(dtype=float),
    ):
        tid = wp.tid()
        x = float(corner[0] + tid % width)
        y = float(corner[1] + tid // width)
        # Start every ray one object size before the origin: distances stay small and precise.
        ahead = rotation[0, 2] * centre[0] + rotation[1, 2] * centre[1] + rotation[2, 2] * centre[2]
        start = wp.max(-ahead - 4.0, 0.0)
        total = wp.vec3(0.0, 0.0, 0.0)
        hits = float(0.0)
        for i in range(samples):
            for j in range(samples):
                u = x + (float(j) + 0.5) / float(samples)
                v = y + (float(i) + 0.5) / float(samples)
                direction = _direction(rotation, inverse_focal, principal, u, v)
                query = wp.mesh_query_ray(mesh, centre + start * direction, direction, 1.0e6)
                if query.result:
                    normal = query.normal
                    if wp.dot(normal, direction) > 0.0:
                        normal = -normal
                    up = 0.5 + 0.5 * normal[2]
                    light = strength[1] * up + strength[2] * (1.0 - up)
                    light += strength[0] * wp.max(wp.dot(normal, to_sun), 0.0)
                    total += albedo[query.face] * light
                    hits += 1.0
        direction = _direction(rotation, inverse_focal, principal, x + 0.5, y + 0.5)
        query = wp.mesh_query_ray(mesh, centre + start * direction, direction, 1.0e6)
        depth = float(0.0)
        if query.result:
            depth = start + query.t  # the direction has unit z, so its parameter is the depth along the optical axis
        colour_out[tid] = total / wp.max(hits, 1.0)
        coverage_out[tid] = hits / float(samples * samples)
        depth_out[tid] = depth

    return _cast


class MeshCaster:
    """A posed triangle mesh ready for rays, on the CPU or a GPU.

    Args:
        faces: vertex indices (face, 3).
        albedo: linear reflectance (face, 3).
        vertices: any first pose, metres (vertex, 3).
        device: a Warp device name; the default device if None.
    """

    def __init__(self, faces: np.ndarray, albedo: np.ndarray, vertices: np.ndarray, device: str | None = None):
        wp.init()
        self._device = wp.get_device(device)
        points = wp.array(np.ascontiguousarray(vertices, np.float32), dtype=wp.vec3, device=self._device)
        indices = wp.array(np.ascontiguousarray(faces, np.int32).ravel(), dtype=wp.int32, device=self._device)
        self._mesh: Any = wp.Mesh(points=points, indices=indices)
        self._albedo = wp.array(np.ascontiguousarray(albedo, np.float32), dtype=wp.vec3, device=self._device)

    def pose(self, vertices: np.ndarray) -> None:
        """Move the vertices (metres, frame of the rays) and refit the hierarchy."""
        self._mesh.points.assign(np.ascontiguousarray(vertices, np.float32))
        self._mesh.refit()

    def cast(
        self,
        intrinsics: np.ndarray,
        frame_from_cam: np.ndarray,
        window: tuple[int, int, int, int],
        *,
        lighting: Lighting,
        samples: int,
    ) -> Window:
        """Cast the pixels of `window` = (x0, y0, x1, y1), exclusive ends; float64 camera in, arrays (y, x, …) out."""
        x0, y0, x1, y1 = window
        width, height = x1 - x0, y1 - y0
        count = width * height
        colour = wp.empty(count, dtype=wp.vec3, device=self._device)
        coverage = wp.empty(count, dtype=float, device=self._device)
        depth = wp.empty(count, dtype=float, device=self._device)
        sun = np.asarray(lighting.sun_direction, np.float64)
        arguments = [
            self._mesh.id,
            self._albedo,
            wp.mat33(*frame_from_cam[:3, :3].ravel().tolist()),
            wp.vec3(*frame_from_cam[:3, 3].tolist()),
            wp.vec2(1.0 / float(intrinsics[0, 0]), 1.0 / float(intrinsics[1, 1])),
            wp.vec2(float(intrinsics[0, 2]), float(intrinsics[1, 2])),
            wp.vec2i(x0, y0),
            width,
            samples,
            wp.vec3(*(sun / np.linalg.norm(sun)).tolist()),
            wp.vec3(lighting.sun, lighting.sky, lighting.ground),
        ]
        wp.launch(_cast_kernel(), dim=count, inputs=arguments, outputs=[colour, coverage, depth], device=self._device)
        shape = (height, width)
        return Window(colour.numpy().reshape(*shape, 3), coverage.numpy().reshape(shape), depth.numpy().reshape(shape))
