"""Rendering of several moving objects before a dome or a landscape: rays only where the objects can be, and truth.

A `RenderedImage` holds the window of the image that the objects touch and what is behind it; whole images are put
together on demand. Coverage is exact to 1/samples²: see `kernels.rays.footprint` for where fewer rays suffice.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int

from aerojax.capture.format import CaptureCamera
from aerojax.core.colour import linear_from_srgb, srgb_from_linear
from aerojax.core.types import Box
from aerojax.geometry.boxes import projected_box
from aerojax.geometry.cameras import points_in_camera, project_points
from aerojax.simulate.render.environment import Environment
from aerojax.simulate.render.image import (
    INTERIOR_SAMPLES,
    MOST_SAMPLES,
    NO_WINDOW,
    ImageConfig,
    RenderedImage,
    Window,
    pinhole,
)
from aerojax.simulate.render.object_truth import bounds, instance_ids, object_view, surface_depth
from aerojax.simulate.render.surfaces import scene_caster
from aerojax.simulate.usd.animated_mesh import AnimatedMesh
from kernels.rays.footprint import CROSSED
from kernels.rays.raytrace import Hits


class SceneRenderer:
    """Renders posed objects for any camera.

    Args:
        meshes: one an object.
        environment: `environment.Dome` or `outdoors.Outdoors`.
        config: what to render.
    """

    def __init__(self, meshes: tuple[AnimatedMesh, ...], environment: Environment, config: ImageConfig):
        self._meshes, self._environment, self._config = meshes, environment, config
        self._caster = scene_caster(meshes, static_mesh=environment.static_mesh)
        self._used = [np.unique(m.faces) for m in meshes]
        self._vertices: list[np.ndarray] = []
        self._next: list[np.ndarray] = []

    def pose(
        self,
        seconds: Sequence[float],
        world_from_body: Float[np.ndarray, "object 4 4"],
        *,
        next_seconds: Sequence[float] | None = None,
        next_world_from_body: Float[np.ndarray, "object 4 4"] | None = None,
    ) -> None:
        """Move every object.

        Args:
            seconds: of each object's own animation.
            world_from_body: rigid, metres.
            next_seconds, next_world_from_body: the same of the next frame, for optical flow; without them flow is 0.
        """
        self._vertices = _world_vertices(self._meshes, seconds, world_from_body)
        for index, (vertices, pose) in enumerate(zip(self._vertices, world_from_body, strict=True)):
            self._caster.pose(index, vertices - pose[:3, 3], pose[:3, 3])
        still = next_seconds is None or next_world_from_body is None
        self._next = self._vertices if still else _world_vertices(self._meshes, next_seconds, next_world_from_body)

    def image(self, camera: CaptureCamera, *, time: float = 0.0) -> RenderedImage:
        """What a camera sees of the last pose; the mask value of object k is k + 1.

        Args:
            camera: pinhole.
            time: seconds since the sequence began, for sun and clouds.
        """
        boxes = [projected_box(v[u], camera) for v, u in zip(self._vertices, self._used, strict=True)]
        background = self._environment.background(camera, time, self._caster)
        found = self._candidates(camera, boxes)
        hits = None
        if found is not None:
            hits = self._caster.cast(
                pinhole(camera), *found, lighting=self._environment.lighting(time), texture_samples=self._config.samples
            )
        return self._assembled(camera, boxes, background, hits, time)

    def _candidates(self, camera: CaptureCamera, boxes: list[Box | None]) -> tuple[np.ndarray, np.ndarray] | None:
        """Pixels (row·width + column, ascending) that any object may touch, and rays along a side of each."""
        pixels, samples = [], []
        for index, box in enumerate(boxes):
            window = self._window(index, box, camera)
            if window is None:
                continue
            if box is None:
                marked = np.full((camera.height, camera.width), CROSSED, np.int32)
            else:
                marked = self._caster.footprint(index, pinhole(camera), window)
            rows, columns = np.nonzero(marked)
            pixels.append((rows + window[1]) * camera.width + columns + window[0])
            samples.append(self._samples(box, marked[rows, columns]))
        if not pixels or not sum(map(len, pixels)):
            return None
        if len(pixels) == 1:
            return pixels[0], samples[0]
        joined, inverse = np.unique(np.concatenate(pixels), return_inverse=True)
        most = np.zeros(len(joined), np.int32)
        np.maximum.at(most, inverse, np.concatenate(samples))
        return joined, most

    def _samples(self, box: Box | None, marks: np.ndarray) -> Int[np.ndarray, "pixel"]:
        """Rays along a side of the pixels of one object; as many at edges of a static mesh, which no mark knows."""
        least, side = self._config.samples, np.inf if box is None else max(box[2] - box[0], box[3] - box[1])
        fine = int(np.clip(np.ceil(self._config.rays_across / max(side, 1.0)), least, max(least, MOST_SAMPLES)))
        inside = least if self._environment.static_mesh is not None else min(least, INTERIOR_SAMPLES)
        return np.where(marks == CROSSED, fine, inside).astype(np.int32)

    def _window(self, index: int, box: Box | None, camera: CaptureCamera) -> Window | None:
        """Whole pixels that an object can touch, inside the image; the whole image where it passes the camera."""
        if box is None:
            ahead = points_in_camera(self._vertices[index], camera)[:, 2] > 0.0
            return (0, 0, camera.width, camera.height) if ahead.any() else None
        x0, y0 = (max(math.floor(low - 0.01), 0) for low in box[:2])
        x1, y1 = min(math.ceil(box[2] + 0.01), camera.width), min(math.ceil(box[3] + 0.01), camera.height)
        return (x0, y0, x1, y1) if x1 > x0 and y1 > y0 else None

    def _assembled(
        self,
        camera: CaptureCamera,
        boxes: list[Box | None],
        background: np.ndarray,
        hits: Hits | None,
        time: float,
    ) -> RenderedImage:
        config, window = self._config, NO_WINDOW if hits is None else bounds(hits.pixels, camera.width)
        canvas = _Canvas(camera.width, window, hits)
        visible = np.zeros(0) if hits is None else hits.visible.sum(axis=1) / hits.rays
        mask = np.zeros(0, np.uint16) if hits is None else instance_ids(hits, visible, config.mask_threshold)
        depth = np.zeros(0, np.float32) if hits is None else surface_depth(hits, mask)
        views = tuple(object_view(k, box, hits, mask, self._caster.origin(k), camera) for k, box in enumerate(boxes))
        return RenderedImage(
            width=camera.width,
            height=camera.height,
            window=window,
            background=background,
            rgb=self._colours(canvas, background, visible, time),
            mask=canvas.paint(mask),
            coverage=canvas.paint(visible.astype(np.float32)) if config.coverage else None,
            depth=canvas.paint(depth) if config.depth else None,
            normal=canvas.paint(np.zeros((0, 3), np.float32) if hits is None else hits.normal)
            if config.normals
            else None,
            flow=canvas.paint(self._flow(hits, camera)) if config.flow else None,
            objects=views,
            rays=0 if hits is None else int(hits.rays.sum()) + len(hits.pixels),
        )

    def _colours(self, canvas: _Canvas, background: np.ndarray, visible: np.ndarray, time: float) -> np.ndarray:
        x0, y0, x1, y1 = canvas.window
        if background.ndim == 1:
            rgb = np.empty((y1 - y0, x1 - x0, 3), np.float32)
            rgb[:] = background
        else:
            rgb = background[y0:y1, x0:x1] / np.float32(255.0)
        if canvas.hits is not None:
            shown = np.flatnonzero(visible > 0)
            hits, alpha = canvas.hits, visible[shown, None].astype(np.float32)
            counts = hits.visible[shown].sum(axis=1)
            mean_depth = (hits.depths[shown].sum(axis=1) / counts).astype(np.float32)
            colour = self._environment.through_air(hits.colour[shown], mean_depth, time)
            rows, columns = canvas.rows[shown], canvas.columns[shown]
            behind = linear_from_srgb(rgb[rows, columns])
            rgb[rows, columns] = srgb_from_linear(np.clip(alpha * colour + (1 - alpha) * behind, 0.0, 1.0))
        return rgb

    def _flow(self, hits: Hits | None, camera: CaptureCamera) -> Float[np.ndarray, "pixel 2"]:
        """Where each pixel's surface point goes until the next pose, in pixels; 0 where it leaves the view."""
        if hits is None:
            return np.zeros((0, 2), np.float32)
        moved = np.zeros((len(hits.pixels), 2))
        for k, mesh in enumerate(self._meshes):
            chosen = np.flatnonzero(hits.object == k)
            corners = mesh.faces[hits.face[chosen]]
            first, second = hits.barycentric[chosen].astype(np.float64).T
            weights = np.stack([first, second, 1.0 - first - second], axis=1)
            before = np.einsum("pc,pcd->pd", weights, self._vertices[k][corners])
            after = np.einsum("pc,pcd->pd", weights, self._next[k][corners])
            ends = (project_points(points, camera, behind=np.nan) for points in (after, before))
            moved[chosen] = np.nan_to_num(np.subtract(*ends))
        return moved.astype(np.float32)


class _Canvas:
    """Puts values of a list of pixels into the window's arrays."""

    def __init__(self, width: int, window: Window, hits: Hits | None):
        self.window, self.hits = window, hits
        pixels = np.zeros(0, np.int64) if hits is None else hits.pixels
        self.rows, self.columns = pixels // width - window[1], pixels % width - window[0]

    def paint(self, values: np.ndarray) -> np.ndarray:
        """A window of zeros with the values in it."""
        x0, y0, x1, y1 = self.window
        out = np.zeros((y1 - y0, x1 - x0, *values.shape[1:]), values.dtype)
        out[self.rows, self.columns] = values
        return out


def _world_vertices(
    meshes: tuple[AnimatedMesh, ...], seconds: Sequence[float], world_from_body: Float[np.ndarray, "object 4 4"]
) -> list[Float[np.ndarray, "_ 3"]]:
    """Float64 vertices of every object, metres, world."""
    return [
        mesh.vertices_at(float(s)).astype(np.float64) @ pose[:3, :3].T + pose[:3, 3]
        for mesh, s, pose in zip(meshes, seconds, world_from_body, strict=True)
    ]
