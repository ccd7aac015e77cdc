"""A static landscape seen by static cameras: cast once into a buffer of surfaces, lit again as often as needed (Warp).

A pixel has one sample at its centre; pixels where depth or normal jump get `edge_samples`² more, which replace it. What
moves is not in the buffer: its shadows are cast on the stored surfaces, in a part of the image where they can fall.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, no_type_check

import numpy as np
import warp as wp

from kernels.rays.colour import srgb_byte_function
from kernels.rays.object_rays import structure
from kernels.rays.raytrace import Lighting, Pinhole, SceneCaster

PLAIN, FIELDS, FOLIAGE = 0, 1, 2
"""Kinds of faces: one colour with a little grain, farmland whose colour changes with the field, broken foliage."""

CameraRays = structure(
    "CameraRays",
    rotation=wp.mat33,
    centre=wp.vec3,
    inverse_focal=wp.vec2,
    principal=wp.vec2,
    width=int,
    edge_samples=int,
    pixels=int,
)
"""A camera; `pixels` is where the samples of edge pixels begin."""

Atmosphere = structure(
    "Atmosphere", to_sun=wp.vec3, sun=wp.vec3, sky=wp.vec3, ground=wp.vec3, extinction=float, airlight=wp.vec3
)
"""Light and haze: what is scattered in, and the extinction a metre."""


@dataclass(frozen=True)
class LandscapeMesh:
    """Static triangles in the world frame, metres; linear albedo, kind and field palette of their faces."""

    vertices: np.ndarray
    faces: np.ndarray
    albedo: np.ndarray
    kind: np.ndarray
    palette: np.ndarray
    seed: int


@dataclass
class SurfaceBuffer:
    """Surfaces that one camera sees, on the device: a sample a pixel, then the samples of edge pixels.

    edge: number of an edge pixel, -1 elsewhere (pixel). lit: 1 where the sun reaches. rays: cast so far.
    """

    camera: Pinhole
    eye: Any
    edge: Any
    albedo: Any
    normal: Any
    depth: Any
    lit: Any
    rays: int = 0


@no_type_check  # Warp compiles these from their source; a run-time checker around them would hide it
@lru_cache(maxsize=1)
def _kernels() -> tuple[Any, Any, Any]:
    encoded = srgb_byte_function()

    @wp.func
    def _direction(eye: CameraRays, pixel: int, part: int, side: int) -> wp.vec3:
        u = float(pixel % eye.width) + (float(part % side) + 0.5) / float(side)
        v = float(pixel // eye.width) + (float(part // side) + 0.5) / float(side)
        x = (u - eye.principal[0]) * eye.inverse_focal[0]
        y = (v - eye.principal[1]) * eye.inverse_focal[1]
        return eye.rotation * wp.vec3(x, y, 1.0)

    @wp.func
    def _grain(seed: int, point: wp.vec3, footprint: float, wavelength: float) -> float:
        # Detail finer than two samples would only alias: fade it out.
        weight = wp.clamp(0.5 * wavelength / footprint - 0.5, 0.0, 1.0)
        value = float(0.0)
        if weight > 0.0:
            value = weight * wp.noise(wp.rand_init(seed), point / wavelength)
        return value

    @wp.func
    def _field(palette: wp.array(dtype=wp.vec3), seed: int, point: wp.vec3) -> wp.vec3:
        x = 0.891 * point[0] + 0.454 * point[1] + 12.0 * wp.sin(0.011 * point[1])
        y = 0.891 * point[1] - 0.454 * point[0] + 9.0 * wp.sin(0.013 * point[0])
        column = int(wp.floor(x / 130.0))
        row = int(wp.floor((y + 37.0 * float(column)) / 85.0))
        choice = wp.randf(wp.rand_init(seed, 9176 * column + row))
        colour = palette[wp.min(int(choice * float(palette.shape[0])), palette.shape[0] - 1)]
        return colour * (1.0 + 0.12 * wp.sin(2.1 * x) * wp.randf(wp.rand_init(seed + 1, 9176 * column + row)))

    @wp.kernel
    def _cast(
        mesh: wp.uint64,
        albedo: wp.array(dtype=wp.vec3),
        kind: wp.array(dtype=int),
        palette: wp.array(dtype=wp.vec3),
        seed: int,
        eye: CameraRays,
        pixels: wp.array(dtype=int),
        first: int,
        side: int,
        albedo_out: wp.array(dtype=wp.vec3h),
        normal_out: wp.array(dtype=wp.vec3h),
        depth_out: wp.array(dtype=float),
    ):
        tid = wp.tid()
        direction = _direction(eye, pixels[tid // (side * side)], tid % (side * side), side)
        query = wp.mesh_query_ray(mesh, eye.centre, direction, 1.0e5)
        depth = float(0.0)
        colour = wp.vec3(0.0, 0.0, 0.0)
        normal = wp.vec3(0.0, 0.0, 0.0)
        if query.result:
            depth = query.t
            normal = query.normal
            if wp.dot(normal, direction) > 0.0:
                normal = -normal
            point = eye.centre + depth * direction
            # A ground that slopes away from the camera stretches a pixel.
            slope = wp.max(wp.abs(wp.dot(normal, direction)) / wp.length(direction), 0.05)
            footprint = depth * eye.inverse_focal[0] / slope
            colour = albedo[query.face]
            strength = float(0.15)
            if kind[query.face] == 1:
                colour = _field(palette, seed, point)
                strength = 0.3
            if kind[query.face] == 2:
                strength = 0.55
            grain = _grain(seed, point, footprint, 9.0) + _grain(seed + 1, point, footprint, 1.3)
            grain += _grain(seed + 2, point, footprint, 0.3)
            colour = colour * wp.max(1.0 + strength * grain, 0.1)
            if kind[query.face] == 2:
                wobble = wp.vec3(
                    _grain(seed + 3, point, footprint, 0.5),
                    _grain(seed + 4, point, footprint, 0.5),
                    _grain(seed + 5, point, footprint, 0.5),
                )
                normal = wp.normalize(normal + 1.2 * wobble)
        albedo_out[first + tid] = wp.vec3h(colour)
        normal_out[first + tid] = wp.vec3h(normal)
        depth_out[first + tid] = depth

    @wp.func
    def _pixel_and_part(eye: CameraRays, edges: wp.array(dtype=int), sample: int):
        pixel = sample
        part = wp.int32(0)
        side = wp.int32(1)
        if sample >= eye.pixels:
            side = eye.edge_samples
            pixel = edges[(sample - eye.pixels) // (side * side)]
            part = (sample - eye.pixels) % (side * side)
        return pixel, part, side

    @wp.kernel
    def _sunlit(
        mesh: wp.uint64,
        eye: CameraRays,
        edges: wp.array(dtype=int),
        to_sun: wp.vec3,
        normal: wp.array(dtype=wp.vec3h),
        depth: wp.array(dtype=float),
        lit_out: wp.array(dtype=wp.uint8),
    ):
        tid = wp.tid()
        lit = wp.uint8(0)
        towards = wp.vec3(normal[tid])
        if depth[tid] > 0.0 and wp.dot(towards, to_sun) > 0.0:
            pixel, part, side = _pixel_and_part(eye, edges, tid)
            point = eye.centre + depth[tid] * _direction(eye, pixel, part, side)
            away = 0.01 + 2.0e-5 * depth[tid]
            if not wp.mesh_query_ray_anyhit(mesh, point + away * (towards + to_sun), to_sun, 1.0e5):
                lit = wp.uint8(1)
        lit_out[tid] = lit

    @wp.func
    def _shaded(
        meshes: wp.array(dtype=wp.uint64),
        centres: wp.array(dtype=wp.vec3),
        radii: wp.array(dtype=float),
        objects: int,
        ray: wp.vec3,
        to_sun: wp.vec3,
    ) -> bool:
        shaded = bool(False)
        for k in range(objects):
            start = centres[k] + ray  # the surface point in the object's frame
            along = -wp.dot(start, to_sun)
            if along > -radii[k] and wp.length(start + along * to_sun) < radii[k]:  # noqa: SIM102 (as below)
                if wp.mesh_query_ray_anyhit(meshes[k], start + 0.005 * to_sun, to_sun, 1.0e5):
                    shaded = True
        return shaded

    @wp.kernel
    def _light(
        eye: CameraRays,
        air: Atmosphere,
        corner: wp.vec2i,
        columns: int,
        edge: wp.array(dtype=int),
        albedo: wp.array(dtype=wp.vec3h),
        normal: wp.array(dtype=wp.vec3h),
        depth: wp.array(dtype=float),
        lit: wp.array(dtype=wp.uint8),
        sky: wp.array(dtype=wp.vec3),
        meshes: wp.array(dtype=wp.uint64),
        centres: wp.array(dtype=wp.vec3),
        radii: wp.array(dtype=float),
        objects: int,
        image: wp.array(dtype=wp.uint8),
    ):
        tid = wp.tid()
        pixel = (corner[1] + tid // columns) * eye.width + corner[0] + tid % columns
        side = wp.int32(1)
        first = pixel
        if edge[pixel] >= 0:
            side = eye.edge_samples
            first = eye.pixels + edge[pixel] * side * side
        # With casters of shadows given, only what they shade changes.
        changed = bool(objects == 0)
        if objects > 0:
            for part in range(side * side):
                if lit[first + part] != wp.uint8(0):
                    ray = depth[first + part] * _direction(eye, pixel, part, side)
                    if _shaded(meshes, centres, radii, objects, ray, air.to_sun):
                        changed = True
        if not changed:
            return
        total = wp.vec3(0.0, 0.0, 0.0)
        for part in range(side * side):
            z = depth[first + part]
            colour = sky[pixel]
            if z > 0.0:
                towards = wp.vec3(normal[first + part])
                up = 0.5 + 0.5 * towards[2]
                light = up * air.sky + (1.0 - up) * air.ground
                direction = _direction(eye, pixel, part, side)
                if lit[first + part] != wp.uint8(0):  # noqa: SIM102 (Warp evaluates both sides of `and`)
                    if not _shaded(meshes, centres, radii, objects, z * direction, air.to_sun):
                        light += wp.max(wp.dot(towards, air.to_sun), 0.0) * air.sun
                clear = wp.exp(-air.extinction * z * wp.length(direction))
                surface = wp.cw_mul(wp.vec3(albedo[first + part]), light)
                colour = clear * surface + (1.0 - clear) * air.airlight
            total += colour
        total = total / float(side * side)
        image[3 * pixel] = encoded(total[0])
        image[3 * pixel + 1] = encoded(total[1])
        image[3 * pixel + 2] = encoded(total[2])

    return _cast, _sunlit, _light


class LandscapeCaster:
    """A landscape ready for rays; `mesh` is the Warp mesh, in the world frame."""

    def __init__(self, landscape: LandscapeMesh, device: str | None = None):
        self._device, self._seed = wp.get_device(device), landscape.seed
        points = self._array(landscape.vertices.astype(np.float32), wp.vec3)
        self.mesh: Any = wp.Mesh(points=points, indices=self._array(landscape.faces.astype(np.int32).ravel(), wp.int32))
        self._albedo = self._array(landscape.albedo.astype(np.float32), wp.vec3)
        self._kind = self._array(landscape.kind.astype(np.int32), wp.int32)
        self._palette = self._array(landscape.palette.astype(np.float32), wp.vec3)
        self._buffers: dict[bytes, SurfaceBuffer] = {}

    def _array(self, values: np.ndarray, kind: Any) -> Any:
        return wp.array(np.ascontiguousarray(values), dtype=kind, device=self._device)

    def buffer(self, camera: Pinhole, edge_samples: int) -> SurfaceBuffer:
        """What a camera sees: every pixel's centre, then the samples of the pixels at edges.

        Cast once a camera; later calls give the same buffer, whose sun is the one cast last.
        """
        parts = (camera.K, camera.rotation, camera.centre, [camera.width, camera.height, edge_samples])
        key = b"".join(np.asarray(part, np.float64).tobytes() for part in parts)
        if key not in self._buffers:
            self._buffers[key] = self._cast_buffer(camera, edge_samples)
        return self._buffers[key]

    def _cast_buffer(self, camera: Pinhole, edge_samples: int) -> SurfaceBuffer:
        pixels, eye = camera.width * camera.height, _eye(camera, edge_samples)
        everything = np.arange(pixels, dtype=np.int32)
        base = self._cast(eye, everything, 0, 1, [None, None, None], pixels)
        edges = _edge_pixels(base[1].numpy(), base[2].numpy(), camera)
        total = pixels + len(edges) * edge_samples**2
        arrays = self._cast(eye, edges, pixels, edge_samples, base, total)
        number = np.full(pixels, -1, np.int32)
        number[edges] = np.arange(len(edges), dtype=np.int32)
        lit = wp.zeros(total, dtype=wp.uint8, device=self._device)
        edge = self._array(number, wp.int32)
        albedo, normal, depth = arrays
        return SurfaceBuffer(camera, eye, edge, albedo, normal, depth, lit, total)

    def _cast(self, eye: Any, pixels: np.ndarray, first: int, side: int, old: list[Any], total: int) -> list[Any]:
        out = [wp.zeros(total, dtype=kind, device=self._device) for kind in (wp.vec3h, wp.vec3h, wp.float32)]
        for new, before in zip(out, old, strict=True):
            if before is not None:
                wp.copy(new, before, count=first)
        inputs = [self.mesh.id, self._albedo, self._kind, self._palette, self._seed, eye]
        inputs += [self._array(pixels, wp.int32), first, side]
        count = len(pixels) * side * side
        if count:
            wp.launch(_kernels()[0], dim=count, inputs=inputs, outputs=out, device=self._device)
        return out

    def cast_sun(self, buffer: SurfaceBuffer, to_sun: np.ndarray) -> None:
        """Find the samples that the sun reaches past the landscape itself."""
        edges = np.flatnonzero(buffer.edge.numpy() >= 0).astype(np.int32)
        inputs = [self.mesh.id, buffer.eye, self._array(edges, wp.int32), wp.vec3(*to_sun.tolist())]
        inputs += [buffer.normal, buffer.depth]
        count = len(buffer.depth)
        wp.launch(_kernels()[1], dim=count, inputs=inputs, outputs=[buffer.lit], device=self._device)
        buffer.rays += count

    def light(
        self,
        buffer: SurfaceBuffer,
        image: np.ndarray,
        window: tuple[int, int, int, int],
        *,
        sky: Any,
        lighting: Lighting,
        haze: tuple[float, np.ndarray],
        objects: SceneCaster | None,
    ) -> None:
        """Light the pixels of a window into `image` (sRGB bytes, in place), with the shadows of `objects`.

        Args:
            buffer: what the camera sees.
            image: of the camera's size.
            window: x0 y0 x1 y1, ends exclusive.
            sky: linear light behind the landscape, from `upload`.
            lighting: sun, sky and ground; its shadows are those of `cast_sun`.
            haze: extinction a metre and linear light of infinitely thick air.
            objects: posed casters of shadows; None for none.
        """
        x0, y0, x1, y1 = window
        if x1 <= x0 or y1 <= y0:
            return
        meshes, centres, radii = ([], [], []) if objects is None else objects.shadow_casters(buffer.camera)
        shared = wp.array(image.reshape(-1), dtype=wp.uint8, device="cpu", copy=False)
        target = shared.to(self._device)  # itself on the CPU
        inputs = [buffer.eye, _air(lighting, haze), wp.vec2i(x0, y0), x1 - x0, buffer.edge, buffer.albedo]
        inputs += [buffer.normal, buffer.depth, buffer.lit, sky]
        inputs += [self._array(np.array(meshes, np.uint64), wp.uint64)]
        inputs += [self._array(np.array(centres, np.float32).reshape(-1, 3), wp.vec3)]
        inputs += [self._array(np.array(radii, np.float32), wp.float32), len(meshes), target]
        wp.launch(_kernels()[2], dim=(x1 - x0) * (y1 - y0), inputs=inputs, device=self._device)
        if not self._device.is_cpu:
            image[:] = target.numpy().reshape(image.shape)

    def upload(self, sky: np.ndarray) -> Any:
        """A sky image (height, width, 3; float32, linear) for `light`; shares memory with it on the CPU."""
        host = wp.array(np.ascontiguousarray(sky.reshape(-1, 3)), dtype=wp.vec3, device="cpu", copy=False)
        return host.to(self._device)


def _eye(camera: Pinhole, edge_samples: int) -> Any:
    eye = CameraRays()
    eye.rotation, eye.centre = wp.mat33(*camera.rotation.ravel().tolist()), wp.vec3(*camera.centre.tolist())
    eye.inverse_focal = wp.vec2(1.0 / float(camera.K[0, 0]), 1.0 / float(camera.K[1, 1]))
    eye.principal = wp.vec2(float(camera.K[0, 2]), float(camera.K[1, 2]))
    eye.width, eye.edge_samples, eye.pixels = camera.width, edge_samples, camera.width * camera.height
    return eye


def _air(lighting: Lighting, haze: tuple[float, np.ndarray]) -> Any:
    air, direction = Atmosphere(), np.asarray(lighting.sun_direction, np.float64)
    air.to_sun = wp.vec3(*(direction / np.linalg.norm(direction)).tolist())
    air.sun = wp.vec3(*(lighting.sun * np.asarray(lighting.sun_colour)).tolist())
    air.sky = wp.vec3(*(lighting.sky * np.asarray(lighting.sky_colour)).tolist())
    air.ground = wp.vec3(*(lighting.ground * np.asarray(lighting.ground_colour)).tolist())
    air.extinction, air.airlight = float(haze[0]), wp.vec3(*np.asarray(haze[1], np.float64).tolist())
    return air


def _edge_pixels(normal: np.ndarray, depth: np.ndarray, camera: Pinhole) -> np.ndarray:
    """Pixels whose depth differs by 2 % or whose normal turns by 40 degrees to a neighbour at the right or below."""
    depth = depth.reshape(camera.height, camera.width)
    normal = normal.reshape(camera.height, camera.width, 3)
    inverse = 1.0 / np.where(depth > 0, depth, np.float32(1e9))
    found = np.zeros(depth.shape, bool)
    for axis in (0, 1):
        near = [slice(None)] * 2
        far = [slice(None)] * 2
        near[axis], far[axis] = slice(None, -1), slice(1, None)
        a, b = tuple(near), tuple(far)
        jump = np.abs(inverse[a] - inverse[b]) > 0.02 * np.maximum(inverse[a], inverse[b])
        turn = np.einsum("yxc,yxc->yx", normal[a], normal[b], dtype=np.float32) < 0.77
        jump |= turn & (depth[a] > 0) & (depth[b] > 0)
        found[a] |= jump
        found[b] |= jump
    return np.flatnonzero(found).astype(np.int32)
