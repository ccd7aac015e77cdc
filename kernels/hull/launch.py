"""The hull of one frame, from arrays to arrays: the kernels in their order, on the CPU or a GPU."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from kernels.hull.field import field_kernels, mat34
from kernels.hull.limits import ENOUGH, LEAST_VIEWS, REACH
from kernels.hull.surface import surface_kernels


@dataclass(frozen=True)
class Silhouettes:
    """Square crops of the views that count, float32.

    rgb: (view, size, size, 3). mask: coverage (view, size, size). K: pixels (view, 3, 3).
    cam_from_world: first three rows of the rigid transforms, metres (view, 3, 4). centres: of the cameras (view, 3).
    known: bool (view, size, size), pixels that the other images speak of; None for all.
    """

    rgb: np.ndarray
    mask: np.ndarray
    K: np.ndarray
    cam_from_world: np.ndarray
    centres: np.ndarray
    known: np.ndarray | None = None


@dataclass(frozen=True)
class Grid:
    """side: cells along each axis, even. cell: metres. capacity: surface cells kept. dilation: in cells."""

    side: int
    cell: float
    capacity: int
    dilation: float


@dataclass(frozen=True)
class Surface:
    """float32 arrays of the surface's Gaussians: mean (n, 3), quaternion (n, 4), standard deviations and colour."""

    mean: np.ndarray
    quaternion: np.ndarray
    scale: np.ndarray
    colour: np.ndarray


class _Frame:
    """One frame's arrays on a device."""

    def __init__(self, views: Silhouettes, grid: Grid, device: str):
        self.grid, self.device = grid, device
        self.count, self.size = views.mask.shape[:2]
        self.rgb, self.mask = self.array(views.rgb, wp.vec3), self.array(views.mask, wp.float32)
        self.K, self.centres = self.array(views.K, wp.mat33), self.array(views.centres, wp.vec3)
        self.cam_from_world = self.array(views.cam_from_world, mat34)
        self.cameras = (self.cam_from_world, self.K)
        # No pixels at all stand for all known ones.
        self.known = self.array(np.zeros((0, 0, 0), bool) if views.known is None else views.known, wp.bool)
        self.distance = self.distances(views)

    def array(self, values: np.ndarray, dtype: Any) -> wp.array:
        return wp.array(np.ascontiguousarray(values), dtype=dtype, device=self.device, copy=False)

    def empty(self, shape: Any, dtype: Any) -> wp.array:
        return wp.empty(shape, dtype=dtype, device=self.device)

    def launch(self, kernel: wp.Kernel, dim: Any, *arguments: Any) -> None:
        wp.launch(kernel, dim=dim, inputs=arguments, device=self.device)

    def distances(self, views: Silhouettes) -> wp.array:
        """Signed distance to each silhouette, pixels, positive inside; where an image ends is no outline."""
        if views.known is None:
            return self.distances_of(self.mask)
        shown = self.array(np.where(views.known, views.mask, 0.0).astype(np.float32), wp.float32)
        filled = self.array(np.where(views.known, views.mask, 1.0).astype(np.float32), wp.float32)
        distance = self.distances_of(filled)
        self.launch(field_kernels().outside, distance.shape, self.distances_of(shown), distance)
        return distance

    def distances_of(self, mask: wp.array) -> wp.array:
        """The same of whole images."""
        kernels, shape = field_kernels(), (self.count, self.size, self.size)
        squares, gap, distance = (self.empty(shape, dtype) for dtype in (wp.int32, wp.int32, wp.float32))
        self.launch(kernels.row_distance, shape[:2], mask, REACH, squares)
        self.launch(kernels.column_gap, (self.count, self.size), squares, REACH, gap)
        self.launch(kernels.signed_distance, shape, squares, gap, REACH, distance)
        return distance

    def field(self) -> tuple[wp.array, np.ndarray]:
        """The dilated field, and which cells the surface comes near, in the grid's order."""
        kernels, side, cell = field_kernels(), self.grid.side, self.grid.cell
        half = side // 2
        field, coarse_near = self.empty((side,) * 3, wp.float32), self.empty((half,) * 3, wp.bool)
        outlines = (self.distance, self.known, *self.cameras)
        numbers = (cell, self.grid.dilation * cell, ENOUGH * cell, LEAST_VIEWS)
        self.launch(kernels.coarse, (half,) * 3, *outlines, *numbers, field, coarse_near)
        chosen = np.flatnonzero(coarse_near.numpy()).astype(np.int32)
        near = wp.zeros((side,) * 3, dtype=wp.bool, device=self.device)
        if chosen.size:
            fine = chosen[: half**3 // 4]  # beyond these the coarse values stay, as in the twin
            where = self.array(chosen, wp.int32)
            self.launch(kernels.fine, (fine.size, 8), *outlines, *numbers, where, field)
            self.launch(kernels.near, (chosen.size, 8), field, cell, where, near)
        return field, np.flatnonzero(near.numpy())

    def surface(self, field: wp.array, index: np.ndarray) -> Surface:
        """Gaussians of chosen cells."""
        kernels, n, cell = surface_kernels(), index.size, self.grid.cell
        points, normals, scales, colours = (self.empty(n, wp.vec3) for _ in range(4))
        quaternions, bins = self.empty(n, wp.vec4), self.size // 2
        seen = self.empty((self.count, n), wp.vec3)
        nearest = wp.full((self.count, bins * bins), wp.inf, dtype=wp.float32, device=self.device)
        self.launch(kernels.place, n, self.array(index.astype(np.int32), wp.int32), field, cell, points, normals)
        self.launch(kernels.axes, n, points, normals, field, cell, quaternions, scales)
        # The grown surface lies just off the object: its colour is that of the surface beneath.
        beneath = (points, normals, self.grid.dilation * cell)
        self.launch(kernels.see, seen.shape, *beneath, *self.cameras, bins, seen, nearest)
        looked = (self.centres, seen, nearest, bins, cell, colours)
        self.launch(kernels.colour, n, self.rgb, self.distance, self.known, *beneath, *looked)
        return Surface(points.numpy(), quaternions.numpy(), scales.numpy(), colours.numpy())


def hull_distances(views: Silhouettes, *, device: str = "cpu") -> np.ndarray:
    """Signed distance of each pixel to the outline of coverage > 0.5, pixels, positive inside, (view, size, size)."""
    return _Frame(views, Grid(2, 1.0, 1, 0.0), device).distance.numpy()


def empty_surface() -> Surface:
    """No Gaussians."""
    return Surface(*(np.zeros((0, width), np.float32) for width in (3, 4, 3, 3)))


def thinned(cells: np.ndarray, capacity: int) -> np.ndarray:
    """All cells, or `capacity` of them evenly by rank, in single precision as the twin does."""
    if cells.size <= capacity:
        return cells
    stride = np.float32(cells.size) / np.float32(capacity)
    return cells[(np.arange(capacity, dtype=np.float32) * stride).astype(np.int32)]


def hull_surface(views: Silhouettes, grid: Grid, *, device: str = "cpu") -> Surface:
    """Gaussians on the surface of the hull of silhouettes; none where they meet nowhere.

    Args:
        views: at least one, with the object near the world's origin.
        grid: resolution of the cube about the origin.
        device: Warp's name of it, such as `cpu` or `cuda:0`.
    """
    frame = _Frame(views, grid, device)
    field, cells = frame.field()
    if not cells.size:
        return empty_surface()
    # A cube's faces have 6 side² cells within 0.87 cells of them; what exceeds this is no surface.
    return frame.surface(field, thinned(cells[: 8 * grid.side**2], grid.capacity))
