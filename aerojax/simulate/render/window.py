"""Rendering of one object before a dome where nothing else is wanted: coverage, colour and mask of its window.

As `scene.SceneRenderer` shows it, without depth, normals, flow, textures, shadows and what those cost.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Float32

from aerojax.capture.format import CaptureCamera
from aerojax.core.colour import linear_from_srgb, srgb_from_linear
from aerojax.geometry.cameras import pixels_of_camera_points
from aerojax.simulate.render.environment import Dome
from aerojax.simulate.render.image import MOST_SAMPLES, ImageConfig, Window
from aerojax.simulate.usd.animated_mesh import AnimatedMesh
from kernels.rays.raster import rasterise
from kernels.rays.raytrace import Lighting

_NEAREST = 0.01
"""Metres before a camera that every vertex must be."""


@dataclass(frozen=True, eq=False)
class WindowImage:
    """The part of an image that the object can touch.

    window: x0 y0 x1 y1, ends exclusive.
    rgb: sRGB, 0..1, over the background. mask: pixels whose coverage reaches the threshold. background: sRGB.
    """

    window: Window
    rgb: Float32[np.ndarray, "rows columns 3"]
    mask: Bool[np.ndarray, "rows columns"]
    background: Float[np.ndarray, "3"]


@dataclass(frozen=True, eq=False)
class WindowLayers:
    """The object alone in the part of an image that it can touch.

    window: x0 y0 x1 y1, ends exclusive.
    coverage: share of each pixel. colour: linear mean of what covers it. depth: of that, metres, 0 where nothing does.
    """

    window: Window
    coverage: Float32[np.ndarray, "rows columns"]
    colour: Float32[np.ndarray, "rows columns 3"]
    depth: Float32[np.ndarray, "rows columns"]


class WindowRenderer:
    """Renders one posed object for any camera.

    Args:
        mesh: with one colour a face; textures are not looked up.
        dome: light and background.
        config: samples and the mask's threshold.
    """

    def __init__(self, mesh: AnimatedMesh, dome: Dome, config: ImageConfig):
        self._mesh, self._dome, self._config = mesh, dome, config
        self._albedo = linear_from_srgb(mesh.albedo)
        self._origin, self._vertices = np.zeros(3), np.zeros((0, 3))
        self._normals, self._middles = np.zeros((0, 3)), np.zeros((0, 3))
        self._sides = (self._albedo, self._albedo)

    def pose(self, seconds: float, world_from_body: Float[np.ndarray, "4 4"]) -> None:
        """Move the object: seconds of its own animation; a rigid transform, metres."""
        turned = self._mesh.vertices_at(seconds).astype(np.float64) @ world_from_body[:3, :3].T
        self._vertices, self._origin = turned, world_from_body[:3, 3]
        a, b, c = (turned[self._mesh.faces[:, i]] for i in range(3))
        normal = np.cross(b - a, c - a)
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
        self._normals, self._middles = normal, a
        light = self._dome.lighting(0.0)
        self._sides = (self._albedo * irradiance(normal, light), self._albedo * irradiance(-normal, light))

    def image(self, camera: CaptureCamera) -> WindowImage | None:
        """What a camera sees of the last pose; None where that is nothing, or any vertex is not before it."""
        layers = self.layers(camera)
        if layers is None:
            return None
        background = self._dome.behind(camera)
        mask = layers.coverage >= self._config.mask_threshold - 1e-6
        return WindowImage(layers.window, _over(layers.coverage, layers.colour, background), mask, background)

    def layers(self, camera: CaptureCamera) -> WindowLayers | None:
        """As `image`, before anything is behind the object."""
        centre = camera.world_from_cam[:3, 3] - self._origin
        inside = (self._vertices - centre) @ camera.world_from_cam[:3, :3]
        if inside[:, 2].min() < _NEAREST:
            return None
        pixels = pixels_of_camera_points(inside, camera)
        (low, high) = pixels.min(axis=0), pixels.max(axis=0)
        x0, y0 = (max(math.floor(v - 0.01), 0) for v in low)
        x1, y1 = min(math.ceil(high[0] + 0.01), camera.width), min(math.ceil(high[1] + 0.01), camera.height)
        if x1 <= x0 or y1 <= y0:
            return None
        towards = np.einsum("fc,fc->f", self._normals, centre - self._middles) >= 0.0
        colours = np.where(towards[:, None], *self._sides)
        points = np.concatenate([pixels - (x0, y0), inside[:, 2:]], axis=1)
        samples = self._samples(float(np.max(high - low)))
        layers = rasterise(points, self._mesh.faces, colours, (x1 - x0, y1 - y0), samples)
        return WindowLayers((x0, y0, x1, y1), *layers)

    def _samples(self, side: float) -> int:
        least = self._config.samples
        return int(np.clip(np.ceil(self._config.rays_across / max(side, 1.0)), least, max(least, MOST_SAMPLES)))


def irradiance(normals: Float[np.ndarray, "face 3"], light: Lighting) -> Float[np.ndarray, "face 3"]:
    """Linear light over π on surfaces with unit normals, world frame: two hemispheres and a sun, without shadows."""
    to_sun = np.asarray(light.sun_direction) / np.linalg.norm(light.sun_direction)
    up = 0.5 + 0.5 * normals[:, 2:]
    sky, ground = light.sky * np.asarray(light.sky_colour), light.ground * np.asarray(light.ground_colour)
    sun = light.sun * np.asarray(light.sun_colour)
    return up * sky + (1.0 - up) * ground + np.maximum(normals @ to_sun, 0.0)[:, None] * sun


def _over(
    coverage: Float32[np.ndarray, "rows columns"],
    colour: Float32[np.ndarray, "rows columns 3"],
    background: Float[np.ndarray, "3"],
) -> Float32[np.ndarray, "rows columns 3"]:
    rgb = np.empty(colour.shape, np.float32)
    rgb[:] = background
    rows, columns = np.nonzero(coverage)
    alpha = coverage[rows, columns, None]
    mixed = alpha * colour[rows, columns] + (1.0 - alpha) * linear_from_srgb(background)
    rgb[rows, columns] = srgb_from_linear(np.clip(mixed, 0.0, 1.0))
    return rgb
