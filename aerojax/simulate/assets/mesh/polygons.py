"""Polygons as triangles: fans where a face is convex, ear clipping (mapbox_earcut) where it is not."""

from __future__ import annotations

import mapbox_earcut
import numpy as np
from jaxtyping import Bool, Float, Int

FLAT = 1e-9
"""Of a face's largest corner: a corner that turns back by less is straight, not concave."""
KEPT_AREA = 1e-3
"""By how much, of its own area, the triangles of a face may miss it; beyond, the face crosses itself."""


def triangulate(
    points: Float[np.ndarray, "vertex 3"], counts: Int[np.ndarray, "polygon"], vertices: Int[np.ndarray, "corner"]
) -> tuple[Int[np.ndarray, "face 3"], Int[np.ndarray, "face"]]:
    """Split polygons into triangles that keep their winding and their area.

    A convex face becomes the fan of its first corner. A concave one is laid into the plane of its area vector (Newell's
    method: Sutherland, Sproull & Schumacker 1974) and clipped ear by ear. Faces that cross themselves or have no area
    have no right answer and become fans. Faces of fewer than three corners vanish.

    Args:
        points: any unit.
        counts: corners of each polygon, not negative; they sum to the length of `vertices`.
        vertices: rows of `points`, polygon after polygon.

    Returns:
        Positions in `vertices` of each triangle's corners, and the polygon that it comes from, in the polygons' order.
    """
    start = np.cumsum(counts) - counts
    polygon = np.repeat(np.arange(len(counts)), np.maximum(counts - 2, 0))
    step = np.arange(len(polygon)) - np.searchsorted(polygon, polygon)
    first = start[polygon]
    corners = np.stack([first, first + step + 1, first + step + 2], axis=1)
    concave = np.flatnonzero(counts > 3)
    concave = concave[_is_concave(points, counts, vertices)[concave]]
    if not len(concave):
        return corners, polygon
    kept = ~np.isin(polygon, concave)
    parts, owners = [corners[kept]], [polygon[kept]]
    for face in concave.tolist():
        rows = np.arange(start[face], start[face] + counts[face])
        ears = _clipped(points[vertices[rows]])
        parts.append(corners[polygon == face] if ears is None else rows[ears])
        owners.append(np.full(len(parts[-1]), face, np.int64))
    owner = np.concatenate(owners)
    order = np.argsort(owner, kind="stable")
    return np.concatenate(parts)[order], owner[order]


def _is_concave(
    points: Float[np.ndarray, "vertex 3"], counts: Int[np.ndarray, "polygon"], vertices: Int[np.ndarray, "corner"]
) -> Bool[np.ndarray, "polygon"]:
    """Whether any corner of a polygon turns against its area vector."""
    found = np.zeros(len(counts), bool)
    for size in np.unique(counts[counts > 3]).tolist():  # polygons of one size at a time, without a loop over faces
        which = np.flatnonzero(counts == size)
        rows = (np.cumsum(counts) - counts)[which, None] + np.arange(size)
        places = points[vertices[rows]].astype(np.float64)
        before, after = places - np.roll(places, 1, axis=1), np.roll(places, -1, axis=1) - places
        turn = np.cross(before, after)
        along = np.einsum("pcx,px->pc", turn, _area_vectors(places))
        found[which] = (along < -FLAT * np.abs(along).max(axis=1, keepdims=True)).any(axis=1)
    return found


def _area_vectors(places: Float[np.ndarray, "polygon corner 3"]) -> Float[np.ndarray, "polygon 3"]:
    """Normals whose length is the area of each polygon."""
    moved = places - places[:, :1]
    return np.cross(moved, np.roll(moved, -1, axis=1)).sum(axis=1) / 2


def _clipped(places: Float[np.ndarray, "corner 3"]) -> Int[np.ndarray, "face 3"] | None:
    """Triangles of one concave polygon as rows of its corners; None where they would not keep its area."""
    normal = _area_vectors(places[None].astype(np.float64))[0]
    area = float(np.linalg.norm(normal))
    if not area > 0:
        return None
    across = np.cross(normal / area, np.eye(3)[np.argmin(np.abs(normal))])
    across /= np.linalg.norm(across)
    flat = np.ascontiguousarray((places - places[0]) @ np.stack([across, np.cross(normal / area, across)], axis=1))
    ears = mapbox_earcut.triangulate_float64(flat, np.array([len(flat)], np.uint32)).astype(np.int64).reshape(-1, 3)
    one, two = flat[ears[:, 1]] - flat[ears[:, 0]], flat[ears[:, 2]] - flat[ears[:, 0]]
    doubled = one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]
    ears = np.where(doubled[:, None] < 0, ears[:, ::-1], ears)
    if abs(np.abs(doubled).sum() / 2 - area) > KEPT_AREA * area:
        return None
    return ears
