"""Ray casting of posed triangle meshes into a pinhole image: colour, coverage, depth, normals, hits (NVIDIA Warp)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from kernels.rays.footprint import footprint_kernel, neighbours
from kernels.rays.object_rays import Light, Surfaces, View, object_kernel
from kernels.rays.textures import TexturePyramids

Colour = tuple[float, float, float]
WHITE: Colour = (1.0, 1.0, 1.0)


@dataclass(frozen=True)
class Lighting:
    """Light of a scene, linear.

    sun_direction: towards the sun, world frame, any length.
    sun, sky, ground: irradiance over π of the sun at normal incidence and of the hemispheres above and below.
    sun_colour, sky_colour, ground_colour: tints of the three.
    shadows: objects shade themselves and each other.
    """

    sun_direction: tuple[float, float, float] = (0.3, 0.2, 0.93)
    sun: float = 0.45
    sky: float = 0.55
    ground: float = 0.3
    sun_colour: Colour = WHITE
    sky_colour: Colour = WHITE
    ground_colour: Colour = WHITE
    shadows: bool = False


@dataclass(frozen=True)
class Surface:
    """The triangles of one object and what they look like.

    faces: vertex indices (face, 3), counter-clockwise seen from outside.
    albedo: linear reflectance, or the factor of the texture (face, 3).
    uv: texture coordinates of the corners, v upwards (face, 3, 2).
    texture: index into `textures` or -1 (face).
    textures: sRGB bytes (height, width, 3).
    """

    faces: np.ndarray
    albedo: np.ndarray
    uv: np.ndarray
    texture: np.ndarray
    textures: tuple[np.ndarray, ...]


@dataclass(frozen=True)
class Pinhole:
    """A camera for rays: K in pixels, float64 rotation `world_from_cam` and centre in metres, world frame, and size."""

    K: np.ndarray
    rotation: np.ndarray
    centre: np.ndarray
    width: int
    height: int


@dataclass(frozen=True)
class Hits:
    """What the rays of some pixels met.

    pixels: row * width + column, ascending.
    colour: linear, mean of the visible samples (pixel, 3).
    rays: samples cast in a pixel.
    visible, alone: samples that show an object, and that would if it were the only thing (pixel, object).
    points: sum of the visible points, world frame relative to each object's origin (pixel, object, 3).
    depths: sum of the visible depths, metres (pixel, object).
    reach: part of the pixel that the visible samples fill, x0 y0 x1 y1 in 0..1, empty without any (pixel, object, 4).
    depth: of the ray through the pixel's centre, 0 where it meets no object.
    normal: world frame, towards the camera, at the centre or the sample nearest to it; zero without a hit.
    object, face, barycentric: of the same point; weights belong to the face's first two corners.
    winner: object with most samples, -1 without any.
    """

    pixels: np.ndarray
    colour: np.ndarray
    rays: np.ndarray
    visible: np.ndarray
    alone: np.ndarray
    points: np.ndarray
    depths: np.ndarray
    reach: np.ndarray
    depth: np.ndarray
    normal: np.ndarray
    object: np.ndarray
    face: np.ndarray
    barycentric: np.ndarray
    winner: np.ndarray


def texture_density(surface: Surface, vertices: np.ndarray) -> np.ndarray:
    """Texels a metre of each face: the root of its area in texels over its area in square metres; 0 untextured."""
    a, b, c = (vertices[surface.faces[:, i]].astype(np.float64) for i in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    first, second = surface.uv[:, 1] - surface.uv[:, 0], surface.uv[:, 2] - surface.uv[:, 0]
    flat = np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])
    texels = np.array([t.shape[0] * t.shape[1] for t in surface.textures] + [0], np.float64)[surface.texture]
    return np.sqrt(flat * texels / np.maximum(area, 1e-12)).astype(np.float32)


class SceneCaster:
    """Posed objects ready for rays, on the CPU or a GPU.

    Args:
        surfaces: one an object.
        vertices: any first pose of each, metres (vertex, 3).
        pyramids: of the textures of all surfaces, one surface's after the other's.
        static_mesh: a Warp mesh in the world frame that hides and shades objects; None without one.
        device: a Warp device name; the default device if None.
    """

    def __init__(
        self,
        surfaces: tuple[Surface, ...],
        vertices: tuple[np.ndarray, ...],
        pyramids: TexturePyramids,
        *,
        static_mesh: Any = None,
        device: str | None = None,
    ):
        self._device = wp.get_device(device)
        self._static_mesh = static_mesh
        self._meshes = [self._mesh(s.faces, v) for s, v in zip(surfaces, vertices, strict=True)]
        self._neighbours = [self._array(neighbours(s.faces).ravel(), wp.int32) for s in surfaces]
        self._origins = np.zeros((len(surfaces), 3))
        self._radii = np.ones(len(surfaces), np.float32)
        self._surfaces = self._upload(surfaces, vertices, pyramids)

    def _array(self, values: np.ndarray, kind: Any) -> Any:
        return wp.array(np.ascontiguousarray(values), dtype=kind, device=self._device)

    def _mesh(self, faces: np.ndarray, vertices: np.ndarray) -> Any:
        points = self._array(vertices.astype(np.float32), wp.vec3)
        return wp.Mesh(points=points, indices=self._array(faces.astype(np.int32).ravel(), wp.int32))

    def _upload(
        self, surfaces: tuple[Surface, ...], vertices: tuple[np.ndarray, ...], pyramids: TexturePyramids
    ) -> Any:
        counts = np.array([len(s.faces) for s in surfaces])
        shift = np.cumsum([0, *(len(s.textures) for s in surfaces)])
        texture = [np.where(s.texture >= 0, s.texture + at, -1) for s, at in zip(surfaces, shift, strict=False)]
        density = [texture_density(s, v) for s, v in zip(surfaces, vertices, strict=True)]
        packed = Surfaces()
        packed.meshes = self._array(np.array([m.id for m in self._meshes], np.uint64), wp.uint64)
        packed.first_face = self._array((np.cumsum(counts) - counts).astype(np.int32), wp.int32)
        packed.albedo = self._array(np.concatenate([s.albedo for s in surfaces]).astype(np.float32), wp.vec3)
        packed.uv = self._array(np.concatenate([s.uv.reshape(-1, 2) for s in surfaces]).astype(np.float32), wp.vec2)
        packed.texture = self._array(np.concatenate(texture).astype(np.int32), wp.int32)
        packed.density = self._array(np.concatenate(density), wp.float32)
        packed.texels = self._array(pyramids.texels, wp.uint8)
        packed.linear = self._array(pyramids.linear, wp.float32)
        packed.level_start = self._array(pyramids.start, wp.int32)
        packed.level_size = self._array(pyramids.size, wp.vec2i)
        packed.first_level = self._array(pyramids.first, wp.int32)
        packed.level_count = self._array(pyramids.count, wp.int32)
        packed.static_mesh = wp.uint64(self._static_mesh.id if self._static_mesh is not None else 0)
        return packed

    def pose(self, index: int, turned: np.ndarray, origin: np.ndarray) -> None:
        """Move an object: vertices relative to `origin` (metres, world axes), which is given in the world frame."""
        self._meshes[index].points.assign(np.ascontiguousarray(turned, np.float32))
        self._meshes[index].refit()
        self._origins[index] = origin
        self._radii[index] = float(np.linalg.norm(turned, axis=1).max()) * 1.01 + 0.01

    def origin(self, index: int) -> np.ndarray:
        """World position of an object's frame."""
        return self._origins[index].copy()

    def shadow_casters(self, camera: Pinhole) -> tuple[list[int], np.ndarray, np.ndarray]:
        """Warp meshes of the objects, the camera's centre in the frame of each, and radii around their origins."""
        return [m.id for m in self._meshes], camera.centre - self._origins, self._radii

    def footprint(self, index: int, camera: Pinhole, window: tuple[int, int, int, int]) -> np.ndarray:
        """Marks (row, column) of the pixels of a window that an object may touch; see `kernels.rays.footprint`."""
        x0, y0, x1, y1 = window
        marks = wp.zeros((y1 - y0, x1 - x0), dtype=wp.int32, device=self._device)
        mesh = self._meshes[index]
        arguments = [
            mesh.points,
            mesh.indices,
            self._neighbours[index],
            wp.mat33(*camera.rotation.ravel().tolist()),
            wp.vec3(*(camera.centre - self._origins[index]).tolist()),
            wp.vec2(float(camera.K[0, 0]), float(camera.K[1, 1])),
            wp.vec2(float(camera.K[0, 2]), float(camera.K[1, 2])),
            wp.vec2i(x0, y0),
        ]
        count = len(mesh.indices) // 3
        wp.launch(footprint_kernel(), dim=count, inputs=arguments, outputs=[marks], device=self._device)
        return marks.numpy()

    def cast(
        self, camera: Pinhole, pixels: np.ndarray, samples: np.ndarray, *, lighting: Lighting, texture_samples: int
    ) -> Hits:
        """Cast rays through pixels.

        Args:
            camera: of the pixels.
            pixels: row * width + column (pixel).
            samples: rays along each side of every pixel (pixel); one more goes through its centre.
            lighting: of the scene.
            texture_samples: rays a side that textures are filtered for.
        """
        count, objects = len(pixels), len(self._meshes)
        kernel = object_kernel()
        both = (count, objects)
        layout: list[Any] = [(count, wp.vec3), (count, wp.int32)]  # colour, rays
        layout += [(both, k) for k in (wp.int32, wp.int32, wp.vec3, wp.float32, wp.vec4)]  # visible .. reach
        layout += [(count, k) for k in (wp.float32, wp.vec3, wp.vec3i, wp.vec2)]  # depth .. barycentric
        outputs = [wp.empty(shape, dtype=kind, device=self._device) for shape, kind in layout]
        relative = camera.centre - self._origins
        self._surfaces.centres = self._array(relative.astype(np.float32), wp.vec3)
        self._surfaces.radii = self._array(self._radii, wp.float32)
        inputs = [
            self._array(pixels.astype(np.int32), wp.int32),
            self._array(samples.astype(np.int32), wp.int32),
            self._view(camera, texture_samples),
            _light(lighting),
            self._surfaces,
        ]
        wp.launch(kernel, dim=count, inputs=inputs, outputs=outputs, device=self._device)
        colour, rays, visible, alone, points, depths, reach, depth, normal, hit, weights = (o.numpy() for o in outputs)
        # Points are relative to the object's own frame; sums stay exact because the frame is near.
        return Hits(
            pixels, colour, rays, visible, alone, points, depths, reach, depth, normal,
            object=hit[:, 0], face=hit[:, 1], barycentric=weights, winner=hit[:, 2],
        )  # fmt: skip

    def _view(self, camera: Pinhole, samples: int) -> Any:
        view = View()
        view.rotation = wp.mat33(*camera.rotation.ravel().tolist())
        view.inverse_focal = wp.vec2(1.0 / float(camera.K[0, 0]), 1.0 / float(camera.K[1, 1]))
        view.principal = wp.vec2(float(camera.K[0, 2]), float(camera.K[1, 2]))
        view.world_centre = wp.vec3(*camera.centre.tolist())
        view.width, view.samples, view.count = camera.width, samples, len(self._meshes)
        return view


def _light(lighting: Lighting) -> Any:
    light = Light()
    direction = np.asarray(lighting.sun_direction, np.float64)
    light.to_sun = wp.vec3(*(direction / np.linalg.norm(direction)).tolist())
    light.sun = wp.vec3(*(lighting.sun * np.asarray(lighting.sun_colour)).tolist())
    light.sky = wp.vec3(*(lighting.sky * np.asarray(lighting.sky_colour)).tolist())
    light.ground = wp.vec3(*(lighting.ground * np.asarray(lighting.ground_colour)).tolist())
    light.shadows = int(lighting.shadows)
    return light
