"""Triangles and points of one prim that a stage draws: a mesh or one of UsdGeom's shapes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from pxr import Usd, UsdGeom

from aerojax.core.errors import UserError
from aerojax.simulate.assets.mesh.polygons import triangulate
from aerojax.simulate.usd.gprims import solid

EARLIEST = Usd.TimeCode.EarliestTime()


@dataclass(frozen=True)
class Geometry:
    """A prim's triangles, and its points at a time code in its own space.

    triangles: rows of the points, counter-clockwise seen from outside.
    corners: positions of the same corners in the mesh's list of face vertices.
    polygon: the mesh's face that each triangle comes from.
    """

    triangles: Int[np.ndarray, "face 3"]
    corners: Int[np.ndarray, "face 3"]
    polygon: Int[np.ndarray, "face"]
    points_at: Callable[[float], Float[np.ndarray, "vertex 3"]]
    moves: bool

    def mirrored(self) -> Geometry:
        """The same with every triangle turned."""
        return Geometry(self.triangles[:, ::-1], self.corners[:, ::-1], self.polygon, self.points_at, self.moves)


def geometry_of(prim: Usd.Prim) -> Geometry | None:
    """Geometry of a drawn prim; None where it has no faces.

    Of a subdivision surface its control mesh is taken, as viewers do at their coarsest. Holes (`holeIndices`) stay
    open. Left-handed faces are turned.

    Raises:
        UserError: faces and points do not fit each other, or faces change over time; messages name the prim.
    """
    shape = solid(prim)
    if shape is not None:
        everything = np.arange(len(shape.faces))
        found = Geometry(shape.faces, shape.faces, everything, shape.points_at, shape.moves)
    else:
        found = _mesh(UsdGeom.Mesh(prim))
    if found is not None and UsdGeom.Gprim(prim).GetOrientationAttr().Get() == UsdGeom.Tokens.leftHanded:
        return found.mirrored()
    return found


def _mesh(mesh: UsdGeom.Mesh) -> Geometry | None:
    counts, vertices, holes = (
        _constant(a)
        for a in (mesh.GetFaceVertexCountsAttr(), mesh.GetFaceVertexIndicesAttr(), mesh.GetHoleIndicesAttr())
    )
    if not len(counts):
        return None
    path, attribute = mesh.GetPath(), mesh.GetPointsAttr()
    points = np.asarray(attribute.Get(EARLIEST) or [], np.float64).reshape(-1, 3)
    if not len(points):
        raise UserError("invalid", f"{path}: has faces but no points", "export the mesh again")
    if counts.min() < 0 or counts.sum() != len(vertices):
        raise UserError(
            "invalid",
            f"{path}: faceVertexCounts sum to {counts.sum()}, but faceVertexIndices are {len(vertices)}",
            "export the mesh again",
        )
    wrong = vertices[(vertices < 0) | (vertices >= len(points))]
    if len(wrong):
        raise UserError(
            "invalid", f"{path}: faceVertexIndices names point {wrong[0]} of {len(points)}", "export the mesh again"
        )
    corners, polygon = triangulate(points, counts, vertices)
    kept = ~np.isin(polygon, holes)
    if not kept.any():
        return None
    moves = attribute.ValueMightBeTimeVarying()
    return Geometry(vertices[corners[kept]], corners[kept], polygon[kept], _points(attribute, len(points)), moves)


def _constant(attribute: Usd.Attribute) -> Int[np.ndarray, "_"]:
    """Integers that must be the same at all times."""
    found = np.asarray(attribute.Get(EARLIEST) or [], np.int64)
    if any(not np.array_equal(np.asarray(attribute.Get(t) or [], np.int64), found) for t in attribute.GetTimeSamples()):
        raise UserError(
            "invalid",
            f"{attribute.GetPrim().GetPath()}: {attribute.GetName()} change over time, which is not read",
            "bake the mesh to the same faces at all times",
        )
    return found


def _points(attribute: Usd.Attribute, count: int) -> Callable[[float], Float[np.ndarray, "vertex 3"]]:
    def at(time: float) -> Float[np.ndarray, "vertex 3"]:
        points = np.asarray(attribute.Get(time), np.float64).reshape(-1, 3)
        if len(points) != count or not np.isfinite(points).all():
            what = "are not finite numbers" if len(points) == count else f"are {len(points)}, but {count} at its start,"
            raise UserError(
                "invalid",
                f"{attribute.GetPrim().GetPath()}: points {what} at time code {time:g}",
                "export the mesh again",
            )
        return points

    return at
