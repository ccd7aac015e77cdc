"""Rendering of several moving objects before a dome or a landscape: rays only where the objects can be, and truth.

A `Rendering` holds the window of the image that the objects touch and what is behind it; whole images are put together
on demand. Coverage is exact to 1/samples²: see `kernels.rays.footprint` for where fewer rays suffice.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float, Int, UInt8

from aerojax.capture.format import CaptureCamera
from aerojax.simulate.render.image import (
    INTERIOR_SAMPLES,
    MOST_SAMPLES,
    NO_WINDOW,
    Box,
    ImageConfig,
    ObjectView,
    Rendering,
    Window,
    pinhole,
)
from aerojax.simulate.usd.animated_mesh import AnimatedMesh
from kernels.rays.footprint import CROSSED
from kernels.rays.raytrace import Colour, Hits, Lighting, SceneCaster, Surface


@runtime_checkable
class Environment(Protocol):
    """What surrounds the objects."""

    def lighting(self, time: float) -> Lighting:
        """Light at a time in seconds since the sequence began."""
        ...

    def background(
        self, camera: CaptureCamera, time: float, caster: SceneCaster
    ) -> UInt8[np.ndarray, "height width 3"] | Float[np.ndarray, "3"]:
        """SRGB behind the objects of one camera: one colour, or an image with the objects' shadows."""
        ...

    def through_air(
        self, linear: Float[np.ndarray, "pixel 3"], depth: Float[np.ndarray, "pixel"], time: float
    ) -> Float[np.ndarray, "pixel 3"]:
        """Linear light of surfaces at a depth (metres) as it reaches a camera."""
        ...

    @property
    def scenery(self) -> object | None:
        """Static Warp mesh that hides and shades objects, world frame; None without one."""
        ...


@dataclass(frozen=True)
class Dome:
    """A sphere of one sRGB colour around everything, white by default, with its own light.

    by_camera: colours of single cameras, by name.
    """

    light: Lighting = field(default_factory=Lighting)
    colour: Colour = (1.0, 1.0, 1.0)
    by_camera: Mapping[str, Colour] = field(default_factory=dict)
    scenery: None = None

    def lighting(self, time: float) -> Lighting:
        """The same light at all times."""
        return self.light

    def background(self, camera: CaptureCamera, time: float, caster: SceneCaster) -> Float[np.ndarray, "3"]:
        """The camera's colour."""
        return np.asarray(self.by_camera.get(camera.name, self.colour), np.float32)

    def through_air(
        self, linear: Float[np.ndarray, "pixel 3"], depth: Float[np.ndarray, "pixel"], time: float
    ) -> Float[np.ndarray, "pixel 3"]:
        """Clear air: what came in."""
        return linear


def srgb_from_linear(linear: Float[np.ndarray, "*shape"]) -> Float[np.ndarray, "*shape"]:
    """Encode linear light as sRGB (IEC 61966-2-1), 0..1."""
    linear = np.clip(linear, 0.0, 1.0)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.power(linear, 1 / 2.4) - 0.055).astype(np.float32)


def linear_from_srgb(encoded: Float[np.ndarray, "*shape"]) -> Float[np.ndarray, "*shape"]:
    """Decode sRGB to linear light (IEC 61966-2-1), 0..1."""
    power = np.power((np.maximum(encoded, 0.0) + 0.055) / 1.055, 2.4)
    return np.where(encoded <= 0.04045, encoded / 12.92, power).astype(np.float32)


def project(points_world: Float[np.ndarray, "point 3"], camera: CaptureCamera) -> Float[np.ndarray, "point 2"]:
    """Pixels of world points in float64; NaN behind the camera."""
    rotation, centre = camera.world_from_cam[:3, :3], camera.world_from_cam[:3, 3]
    in_camera = (points_world - centre) @ rotation
    depth = np.where(in_camera[:, 2:] > 1e-6, in_camera[:, 2:], np.nan)
    return (in_camera / depth) @ camera.K[:2].T


def projected_box(points_world: Float[np.ndarray, "point 3"], camera: CaptureCamera) -> Float[np.ndarray, "4"] | None:
    """Box x0, y0, x1, y1 of projected points, pixels, not clipped; None if any point is behind the camera."""
    pixels = project(points_world, camera)
    if np.isnan(pixels).any():
        return None
    return np.concatenate([pixels.min(axis=0), pixels.max(axis=0)])


class SceneRenderer:
    """Renders posed objects for any camera.

    Args:
        meshes: one an object.
        environment: `Dome` or `outdoors.Outdoors`.
        config: what to render.
    """

    def __init__(self, meshes: tuple[AnimatedMesh, ...], environment: Environment, config: ImageConfig):
        surfaces = tuple(Surface(m.faces, linear_from_srgb(m.albedo), m.uv, m.texture, m.textures) for m in meshes)
        self._meshes, self._environment, self._config = meshes, environment, config
        self._caster = SceneCaster(surfaces, tuple(m.vertices_at(0.0) for m in meshes), scenery=environment.scenery)
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

    def image(self, camera: CaptureCamera, object_ids: Sequence[int] | None = None, *, time: float = 0.0) -> Rendering:
        """What a camera sees of the last pose.

        Args:
            camera: pinhole.
            object_ids: mask values, 1 upwards if None.
            time: seconds since the sequence began, for sun and clouds.
        """
        ids = tuple(range(1, len(self._meshes) + 1)) if object_ids is None else tuple(object_ids)
        boxes = [projected_box(v[u], camera) for v, u in zip(self._vertices, self._used, strict=True)]
        background = self._environment.background(camera, time, self._caster)
        found = self._candidates(camera, boxes)
        hits = None
        if found is not None:
            hits = self._caster.cast(
                pinhole(camera), *found, lighting=self._environment.lighting(time), texture_samples=self._config.samples
            )
        return self._assembled(camera, ids, boxes, background, hits, time)

    def _candidates(
        self, camera: CaptureCamera, boxes: list[np.ndarray | None]
    ) -> tuple[np.ndarray, np.ndarray] | None:
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

    def _samples(self, box: np.ndarray | None, marks: np.ndarray) -> Int[np.ndarray, "pixel"]:
        """Rays along a side of the pixels of one object; behind scenery's edges, which no mark knows, as at its own."""
        least, side = self._config.samples, np.inf if box is None else max(box[2] - box[0], box[3] - box[1])
        fine = int(np.clip(np.ceil(self._config.rays_across / max(side, 1.0)), least, max(least, MOST_SAMPLES)))
        inside = least if self._environment.scenery is not None else min(least, INTERIOR_SAMPLES)
        return np.where(marks == CROSSED, fine, inside).astype(np.int32)

    def _window(self, index: int, box: np.ndarray | None, camera: CaptureCamera) -> Window | None:
        """Whole pixels that an object can touch, inside the image; the whole image where it passes the camera."""
        if box is None:
            ahead = (self._vertices[index] - camera.world_from_cam[:3, 3]) @ camera.world_from_cam[:3, 2]
            return (0, 0, camera.width, camera.height) if (ahead > 0.0).any() else None
        x0, y0 = np.maximum(np.floor(box[:2] - 0.01).astype(int), 0)
        x1, y1 = np.minimum(np.ceil(box[2:] + 0.01).astype(int), (camera.width, camera.height))
        return (int(x0), int(y0), int(x1), int(y1)) if x1 > x0 and y1 > y0 else None

    def _assembled(
        self,
        camera: CaptureCamera,
        ids: tuple[int, ...],
        boxes: list[np.ndarray | None],
        background: np.ndarray,
        hits: Hits | None,
        time: float,
    ) -> Rendering:
        config, window = self._config, NO_WINDOW if hits is None else _bounds(hits.pixels, camera.width)
        canvas = _Canvas(camera.width, window, hits)
        visible = np.zeros(0) if hits is None else hits.visible.sum(axis=1) / hits.rays
        mask = np.zeros(0, np.uint16) if hits is None else _instance_ids(hits, visible, ids, config.mask_threshold)
        depth = np.zeros(0, np.float32) if hits is None else _surface_depth(hits, mask)
        views = tuple(
            _object_view(k, ids[k], box, hits, mask, self._vertices[k], self._caster.origin(k), camera)
            for k, box in enumerate(boxes)
        )
        return Rendering(
            width=camera.width,
            height=camera.height,
            window=window,
            background=background,
            rgb=self._colours(canvas, background, visible, time),
            mask=canvas.paint(mask),
            coverage=canvas.paint(visible.astype(np.float32)) if config.coverage else None,
            depth=canvas.paint(depth) if config.depth else None,
            normal=canvas.paint(_masked_normals(hits)) if config.normals else None,
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
            rgb[rows, columns] = srgb_from_linear(alpha * colour + (1 - alpha) * behind)
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
            moved[chosen] = np.nan_to_num(project(after, camera) - project(before, camera))
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


def _bounds(pixels: np.ndarray, width: int) -> Window:
    rows, columns = pixels // width, pixels % width
    return (int(columns.min()), int(rows.min()), int(columns.max()) + 1, int(rows.max()) + 1)


def _instance_ids(hits: Hits, visible: np.ndarray, ids: tuple[int, ...], threshold: float) -> np.ndarray:
    names = np.array([0, *ids], np.uint16)[hits.winner + 1]
    return np.where(visible >= threshold - 1e-9, names, 0).astype(np.uint16)


def _surface_depth(hits: Hits, mask: np.ndarray) -> np.ndarray:
    rows = np.flatnonzero((mask > 0) & (hits.depth == 0))
    winner = hits.winner[rows]
    depth = hits.depth.copy()
    depth[rows] = hits.depths[rows, winner] / hits.visible[rows, winner]
    return depth


def _masked_normals(hits: Hits | None) -> np.ndarray:
    return np.zeros((0, 3), np.float32) if hits is None else hits.normal


def _object_view(
    index: int,
    object_id: int,
    box: np.ndarray | None,
    hits: Hits | None,
    mask: np.ndarray,
    vertices: np.ndarray,
    origin: np.ndarray,
    camera: CaptureCamera,
) -> ObjectView:
    outside = box is None or bool((box[:2] < 0).any() or box[2] > camera.width or box[3] > camera.height)
    exact = None if box is None else (float(box[0]), float(box[1]), float(box[2]), float(box[3]))
    if hits is None:
        return ObjectView(object_id, None, None, exact, 0.0, outside, None)
    mine = hits.pixels[mask == object_id]
    tight = None
    if len(mine):
        x0, y0, x1, y1 = _bounds(mine, camera.width)
        tight = (float(x0), float(y0), float(x1), float(y1))
    share = hits.visible[:, index] / hits.rays
    alone = float((hits.alone[:, index] / hits.rays).sum())
    total = float(share.sum())
    centroid = None
    if total > 0:
        mean = (hits.points[:, index] / hits.rays[:, None]).sum(axis=0, dtype=np.float64) / total + origin
        centroid = (float(mean[0]), float(mean[1]), float(mean[2]))
    visibility, seen = total / alone if alone > 0 else 0.0, _visible_box(hits, index, camera.width)
    return ObjectView(object_id, tight, seen, exact, visibility, outside, centroid)


def _visible_box(hits: Hits, index: int, width: int) -> Box | None:
    seen = hits.visible[:, index] > 0
    if not seen.any():
        return None
    rows, columns = np.divmod(hits.pixels[seen], width)
    part = hits.reach[seen, index].astype(np.float64)
    low = (columns + part[:, 0]).min(), (rows + part[:, 1]).min()
    high = (columns + part[:, 2]).max(), (rows + part[:, 3]).max()
    return (float(low[0]), float(low[1]), float(high[0]), float(high[1]))
