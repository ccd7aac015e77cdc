"""Texture atlases without unwrapping by hand: two triangles a cell, shelf packing of cells, colours baked by texel.

A triangle keeps its shape: it lies on its longest edge, and a second one of about its height, turned by half a turn,
leans on it. Texels outside of a triangle, but near enough for bilinear filtering to read them, are baked at the same
affine map, that is at the continuation of the triangle's plane: no seam can show a neighbour's colour.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, Int, UInt8

from aerojax.core.colour import linear_from_srgb
from aerojax.simulate.assets.mesh.shapes import Mesh

WIDTH = 512
"""Texels across an atlas, and the height that it keeps below unless the triangles are too many."""
DENSITY = 320.0
"""Most texels a metre."""
GUTTER = 0.5
"""Texels between a triangle and the edge of its cell: filtering at a texel's centre reads no other."""


@dataclass(frozen=True)
class Atlas:
    """Where every triangle lies in the image.

    corner: of each face, in texels from the top-left corner of the image.
    height: rows in use; the width is `WIDTH`.
    """

    corner: Float[np.ndarray, "face 3 2"]
    height: int

    def st(self) -> Float[np.ndarray, "face 3 2"]:
        """USD's texture coordinates, whose origin is the bottom-left corner."""
        x, y = self.corner[..., 0] / WIDTH, 1.0 - self.corner[..., 1] / self.height
        return np.stack([x, y], axis=-1)


@dataclass(frozen=True)
class Texels:
    """Texels to be coloured: row and column in the image, the face, and barycentric coordinates (any sign)."""

    row: Int[np.ndarray, "texel"]
    column: Int[np.ndarray, "texel"]
    face: Int[np.ndarray, "texel"]
    barycentric: Float[np.ndarray, "texel 3"]


def lay_out(mesh: Mesh) -> Atlas:
    """Pack the triangles of a mesh (metres) as finely as `DENSITY` and an atlas of `WIDTH` squared allow."""
    corners, size = _lying(mesh)
    density = DENSITY
    while True:
        base = np.clip(np.ceil(size[:, 0] * density), 2, WIDTH * 2 // 3 - 11)  # a cell is at most 1.5 bases wide
        flat = np.stack([base, np.ceil(size[:, 1] * density).clip(1), base * size[:, 2]], axis=1)
        order = np.argsort(-flat[:, 1], kind="stable")  # of one height, neighbours in the mesh stay neighbours
        placed, cells = _pairs(flat[order])
        origin, height = _shelves(cells)
        if height <= WIDTH or density < 1.0:
            break
        density *= 0.92
    placed = (placed + origin[:, None, None, :]).reshape(-1, 3, 2)[: len(corners)]
    corner = np.empty((len(corners), 3, 2))
    corner[order[:, None], corners[order]] = placed
    return Atlas(corner, height)


def _lying(mesh: Mesh) -> tuple[Int[np.ndarray, "face 3"], Float[np.ndarray, "face 3"]]:
    """Corners of each face in the order start of the longest edge, its end, apex; and the edge's length, the height
    over it, and the share of the edge at which the apex stands, which is at least one half."""
    points, rows = mesh.points[mesh.faces], np.arange(len(mesh.faces))[:, None]
    edge = np.linalg.norm(np.roll(points, -1, axis=1) - points, axis=2)
    corners = (edge.argmax(1)[:, None] + np.arange(3)) % 3
    start, end, apex = np.moveaxis(points[rows, corners], 1, 0)
    along, length = end - start, edge.max(1).clip(1e-9)
    share = np.einsum("fi,fi->f", apex - start, along) / length**2
    corners = np.where((share < 0.5)[:, None], corners[:, [1, 0, 2]], corners)
    height = np.linalg.norm(np.cross(along, apex - start), axis=1) / length
    return corners, np.stack([length, height, np.clip(np.maximum(share, 1 - share), 0.5, 1.0)], axis=1)


def _pairs(
    flat: Float[np.ndarray, "face 3"],
) -> tuple[Float[np.ndarray, "cell 2 3 2"], Int[np.ndarray, "cell 2"]]:
    """Corners of both triangles within each cell, and the cells' widths and heights, texels.

    The second triangle's left edge lies over the first one's, so far above it that filtering of one, which reads a
    texel further along both axes, never meets the other.

    Args:
        flat: base, height and place of the apex over the base, texels; faces in order.
    """
    padded = np.concatenate([flat, flat[-1:]]) if len(flat) % 2 else flat
    (base, height, apex), (base2, height2, apex2) = padded[0::2].T, padded[1::2].T
    height = np.maximum(height, height2)
    rise = 2 + height / apex + height / apex2
    right = np.minimum(apex, apex2)
    left = np.minimum(0.0, right - base2)
    zero = np.zeros_like(base)
    one = [(zero, zero), (base, zero), (apex, height)]
    two = [(right, rise + height), (right - base2, rise + height), (right - apex2, rise)]
    corners = np.stack([np.stack([np.stack(c, axis=-1) for c in three], axis=1) for three in (one, two)], axis=1)
    corners[..., 0] -= left[:, None, None]
    cells = np.stack([np.maximum(base, right) - left, rise + height], axis=1) + 2 * GUTTER
    return corners + GUTTER, np.ceil(cells).astype(np.int64)


def _shelves(cells: Int[np.ndarray, "cell 2"]) -> tuple[Int[np.ndarray, "cell 2"], int]:
    """Top-left corners of cells (width, height) put in rows, tallest first; and the height of all rows."""
    origin, x, y, shelf = [], 0, 0, 0
    for width, height in cells.tolist():
        if x + width > WIDTH:
            x, y, shelf = 0, y + shelf, 0
        origin.append((x, y))
        x, shelf = x + width, max(shelf, height)
    return np.array(origin, np.int64).reshape(-1, 2), y + shelf


def texels_of(atlas: Atlas) -> Texels:
    """Every texel that filtering inside a triangle can read, once a triangle."""
    low = np.floor(atlas.corner.min(axis=1) - GUTTER).astype(np.int64)
    high = np.ceil(atlas.corner.max(axis=1) + GUTTER).astype(np.int64)
    span = high - low
    count = span.prod(axis=1)
    face = np.repeat(np.arange(len(count)), count)
    step = np.arange(len(face)) - np.repeat(np.cumsum(count) - count, count)
    column, row = low[face, 0] + step % span[face, 0], low[face, 1] + step // span[face, 0]
    a, b, c = (atlas.corner[:, i] for i in range(3))
    legs = np.linalg.inv(np.stack([b - a, c - a], axis=2))
    centre = np.stack([column, row], axis=1) + 0.5 - a[face]
    share = np.einsum("tij,tj->ti", legs[face], centre)
    barycentric = np.concatenate([1 - share.sum(1, keepdims=True), share], axis=1)
    slope = np.concatenate([-legs.sum(axis=1, keepdims=True), legs], axis=1)
    reach = np.abs(slope).sum(axis=2)  # of one texel along both axes, in barycentric units
    inside = (barycentric > -reach[face] * (1 - 1e-9)).all(axis=1)
    inside &= (column >= 0) & (column < WIDTH) & (row >= 0) & (row < atlas.height)
    return Texels(row[inside], column[inside], face[inside], barycentric[inside])


def interpolate(
    texels: Texels, corners: Float[np.ndarray, "face 3 channel"], chosen: slice | Int[np.ndarray, "chosen"]
) -> Float[np.ndarray, "chosen channel"]:
    """Values at the chosen texels from values at the faces' corners, continued beyond the edges."""
    return np.einsum("tc,tci->ti", texels.barycentric[chosen], corners[texels.face[chosen]])


def compose(
    atlas: Atlas, texels: Texels, srgb: Float[np.ndarray, "texel 3"]
) -> tuple[UInt8[np.ndarray, "row column 3"], Float[np.ndarray, "face 3"]]:
    """The image (sRGB) and each face's mean in linear light, over texels inside it or, if none is, near it."""
    image = np.zeros((atlas.height, WIDTH, 3), np.uint8)
    image[texels.row, texels.column] = np.rint(srgb.clip(0, 1) * 255).astype(np.uint8)
    image = _filled(image, texels)
    linear = linear_from_srgb(srgb)
    inside = (texels.barycentric.min(axis=1) >= -1e-9) + 1e-6
    faces = len(atlas.corner)
    weight = np.bincount(texels.face, inside, faces)
    mean = np.stack([np.bincount(texels.face, inside * linear[:, i], faces) for i in range(3)], axis=1)
    return image, mean / weight[:, None]


def _filled(image: UInt8[np.ndarray, "row column 3"], texels: Texels) -> UInt8[np.ndarray, "row column 3"]:
    """Texels of no triangle take the nearest colour, so that coarser levels of the image mix in nothing foreign."""
    free = np.ones(image.shape[:2], np.uint8)
    free[texels.row, texels.column] = 0
    _, label = cv2.distanceTransformWithLabels(free, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)
    flat = np.zeros(label.max() + 1, np.int64)
    used = np.flatnonzero(free.ravel() == 0)
    flat[label.ravel()[used]] = used
    return image.reshape(-1, 3)[flat[label]]
