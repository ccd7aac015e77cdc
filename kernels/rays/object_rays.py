"""Ray casting of several moving triangle meshes, each in its own frame, with textures and shadows (NVIDIA Warp).

One thread a pixel. Every object's rays run in a frame whose origin lies near that object, so that float32 keeps
sub-millimetre depth from kilometres away, wherever the other objects are. A static mesh (the landscape) may stand in
front of the objects and shade them. Each pixel has a number of rays of its own: few where it is known to be covered
wholly (see `footprint`), many where the object is small.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, no_type_check

import warp as wp

from kernels.rays.textures import sampling_function

SHADOW_OFFSET = 1e-3
"""Metres from a surface to the start of its shadow ray: below the thinnest part, above float32 noise."""


def structure(name: str, **fields: Any) -> Any:
    """A Warp structure, made by a call because run-time type checkers decorate class statements."""
    return wp.struct(type(name, (), {"__annotations__": fields}))


View = structure(
    "View",
    rotation=wp.mat33,
    inverse_focal=wp.vec2,
    principal=wp.vec2,
    world_centre=wp.vec3,
    width=int,
    samples=int,
    count=int,
)
"""A pinhole camera, the number of objects, and its centre in the world frame, which is the static mesh's."""

Light = structure(
    "Light",
    to_sun=wp.vec3,
    sun=wp.vec3,
    sky=wp.vec3,
    ground=wp.vec3,
    shadows=int,
)
"""Linear light; `shadows` is 0 or 1."""

Surfaces = structure(
    "Surfaces",
    meshes=wp.array(dtype=wp.uint64),
    centres=wp.array(dtype=wp.vec3),
    radii=wp.array(dtype=float),
    first_face=wp.array(dtype=int),
    albedo=wp.array(dtype=wp.vec3),
    uv=wp.array(dtype=wp.vec2),
    texture=wp.array(dtype=int),
    density=wp.array(dtype=float),
    texels=wp.array(dtype=wp.uint8),
    linear=wp.array(dtype=float),
    level_start=wp.array(dtype=int),
    level_size=wp.array(dtype=wp.vec2i),
    first_level=wp.array(dtype=int),
    level_count=wp.array(dtype=int),
    static_mesh=wp.uint64,
)
"""Everything about the objects, faces of all of them in one list; `static_mesh` is 0 where there is none."""


@no_type_check  # Warp compiles the kernel from its source; a run-time checker around it would hide it
@lru_cache(maxsize=1)
def object_kernel() -> Any:
    """Kernel over candidate pixels; see `kernels.rays.raytrace.SceneCaster.cast` for its outputs."""
    sample_texture = sampling_function()

    @wp.func
    def _direction(view: View, u: float, v: float) -> wp.vec3:
        x = (u - view.principal[0]) * view.inverse_focal[0]
        y = (v - view.principal[1]) * view.inverse_focal[1]
        return view.rotation * wp.vec3(x, y, 1.0)

    @wp.func
    def _hit(surfaces: Surfaces, view: View, k: int, direction: wp.vec3):
        # Start every ray one object size before the object: distances stay small and precise.
        centre = surfaces.centres[k]
        axis = wp.vec3(view.rotation[0, 2], view.rotation[1, 2], view.rotation[2, 2])
        start = wp.max(-wp.dot(axis, centre) - surfaces.radii[k], 0.0)
        query = wp.mesh_query_ray(surfaces.meshes[k], centre + start * direction, direction, 1.0e6)
        t = float(0.0)
        if query.result:
            t = start + query.t  # the direction has unit z, so its parameter is the depth along the optical axis
        return t, query.face, query.u, query.v, query.normal

    @wp.func
    def _albedo(surfaces: Surfaces, view: View, k: int, face: int, bu: float, bv: float, t: float) -> wp.vec3:
        at = surfaces.first_face[k] + face
        texture = surfaces.texture[at]
        colour = surfaces.albedo[at]
        if texture >= 0:
            uv = bu * surfaces.uv[3 * at] + bv * surfaces.uv[3 * at + 1] + (1.0 - bu - bv) * surfaces.uv[3 * at + 2]
            texels_a_ray = surfaces.density[at] * t * view.inverse_focal[0] / float(view.samples)
            level = int(
                wp.clamp(wp.log2(wp.max(texels_a_ray, 1.0)) + 0.5, 0.0, float(surfaces.level_count[texture] - 1))
            )
            colour = wp.cw_mul(
                colour,
                sample_texture(
                    surfaces.texels,
                    surfaces.linear,
                    surfaces.level_start,
                    surfaces.level_size,
                    surfaces.first_level[texture] + level,
                    uv,
                ),
            )
        return colour

    @wp.func
    def _lit(surfaces: Surfaces, view: View, light: Light, k: int, point: wp.vec3, normal: wp.vec3) -> bool:
        start = point + SHADOW_OFFSET * normal
        lit = bool(True)
        for j in range(view.count):
            moved = start + surfaces.centres[j] - surfaces.centres[k]
            if wp.mesh_query_ray_anyhit(surfaces.meshes[j], moved, light.to_sun, 1.0e6):
                lit = False
        if surfaces.static_mesh != wp.uint64(0):
            moved = start - surfaces.centres[k] + view.world_centre
            if wp.mesh_query_ray_anyhit(surfaces.static_mesh, moved, light.to_sun, 1.0e6):
                lit = False
        return lit

    @wp.func
    def _radiance(
        surfaces: Surfaces, view: View, light: Light, k: int, point: wp.vec3, normal: wp.vec3, albedo: wp.vec3
    ) -> wp.vec3:
        up = 0.5 + 0.5 * normal[2]
        total = up * light.sky + (1.0 - up) * light.ground
        cosine = wp.dot(normal, light.to_sun)
        if cosine > 0.0:
            lit = bool(True)
            if light.shadows != 0:
                lit = _lit(surfaces, view, light, k, point, normal)
            if lit:
                total += cosine * light.sun
        return wp.cw_mul(albedo, total)

    @wp.func
    def _hidden(surfaces: Surfaces, view: View, direction: wp.vec3, t: float) -> bool:
        hidden = bool(False)
        if surfaces.static_mesh != wp.uint64(0):
            hidden = wp.mesh_query_ray_anyhit(surfaces.static_mesh, view.world_centre, direction, t)
        return hidden

    @wp.func
    def _visible(surfaces: Surfaces, view: View, direction: wp.vec3):
        found = wp.int32(0)
        met = wp.int32(0)
        depth = float(1.0e9)
        face = wp.int32(0)
        bu = float(0.0)
        bv = float(0.0)
        normal = wp.vec3(0.0, 0.0, 0.0)
        for k in range(view.count):
            t, f, u, v, n = _hit(surfaces, view, k, direction)
            if t > 0.0:
                met = met | (1 << k)
            if t > 0.0 and t < depth:
                found = k + 1
                depth = t
                face = f
                bu = u
                bv = v
                normal = n
        if found > 0:
            if wp.dot(normal, direction) > 0.0:
                normal = -normal
            if _hidden(surfaces, view, direction, depth):
                found = wp.int32(0)
        return met, found - 1, depth, face, bu, bv, normal

    @wp.kernel
    def _cast(
        pixels: wp.array(dtype=int),
        samples: wp.array(dtype=int),
        view: View,
        light: Light,
        surfaces: Surfaces,
        colour_out: wp.array(dtype=wp.vec3),
        rays_out: wp.array(dtype=int),
        visible_out: wp.array2d(dtype=int),
        alone_out: wp.array2d(dtype=int),
        points_out: wp.array2d(dtype=wp.vec3),
        depths_out: wp.array2d(dtype=float),
        reach_out: wp.array2d(dtype=wp.vec4),
        depth_out: wp.array(dtype=float),
        normal_out: wp.array(dtype=wp.vec3),
        hit_out: wp.array(dtype=wp.vec3i),
        barycentric_out: wp.array(dtype=wp.vec2),
    ):
        tid = wp.tid()
        x = float(pixels[tid] % view.width)
        y = float(pixels[tid] // view.width)
        n = samples[tid]
        for k in range(view.count):
            visible_out[tid, k] = 0
            alone_out[tid, k] = 0
            points_out[tid, k] = wp.vec3(0.0, 0.0, 0.0)
            depths_out[tid, k] = 0.0
            reach_out[tid, k] = wp.vec4(1.0, 1.0, 0.0, 0.0)
        total = wp.vec3(0.0, 0.0, 0.0)
        hits = wp.int32(0)
        for i in range(n):
            for j in range(n):
                u = x + (float(j) + 0.5) / float(n)
                v = y + (float(i) + 0.5) / float(n)
                direction = _direction(view, u, v)
                met, best, depth, face, bu, bv, normal = _visible(surfaces, view, direction)
                for k in range(view.count):
                    alone_out[tid, k] = alone_out[tid, k] + ((met >> k) & 1)
                if best >= 0:
                    point = surfaces.centres[best] + depth * direction
                    albedo = _albedo(surfaces, view, best, face, bu, bv, depth)
                    total += _radiance(surfaces, view, light, best, point, normal, albedo)
                    visible_out[tid, best] = visible_out[tid, best] + 1
                    points_out[tid, best] = points_out[tid, best] + point
                    depths_out[tid, best] = depths_out[tid, best] + depth
                    reach = reach_out[tid, best]
                    reach_out[tid, best] = wp.vec4(
                        wp.min(reach[0], float(j) / float(n)),
                        wp.min(reach[1], float(i) / float(n)),
                        wp.max(reach[2], float(j + 1) / float(n)),
                        wp.max(reach[3], float(i + 1) / float(n)),
                    )
                    hits += 1
        colour_out[tid] = total / float(wp.max(hits, 1))
        rays_out[tid] = n * n
        leader = wp.int32(0)
        most = wp.int32(0)
        for k in range(view.count):
            if visible_out[tid, k] > most:
                most = visible_out[tid, k]
                leader = k + 1
        winner = leader - 1
        # The pixel's own surface point: its centre, or where that misses, the nearest sub-sample on the winner.
        direction = _direction(view, x + 0.5, y + 0.5)
        met, best, depth, face, bu, bv, normal = _visible(surfaces, view, direction)
        depth_out[tid] = 0.0
        if best >= 0:
            depth_out[tid] = depth
        nearest = float(1.0e9)
        if best < 0 and winner >= 0:
            for i in range(n):
                for j in range(n):
                    du = (float(j) + 0.5) / float(n) - 0.5
                    dv = (float(i) + 0.5) / float(n) - 0.5
                    away = du * du + dv * dv
                    if away < nearest:
                        direction = _direction(view, x + 0.5 + du, y + 0.5 + dv)
                        _met, inner, _t, f, a, b, m = _visible(surfaces, view, direction)
                        if inner == winner:
                            nearest = away
                            best = inner
                            face = f
                            bu = a
                            bv = b
                            normal = m
        if best < 0:
            normal = wp.vec3(0.0, 0.0, 0.0)
        normal_out[tid] = normal
        hit_out[tid] = wp.vec3i(best, face, winner)
        barycentric_out[tid] = wp.vec2(bu, bv)

    return _cast
