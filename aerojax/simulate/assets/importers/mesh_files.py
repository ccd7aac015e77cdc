"""STL and PLY meshes as imported scenes, read by trimesh; polygons are triangulated here, because it fans them."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from jaxtyping import Float

from aerojax.core.colour import linear_from_srgb
from aerojax.core.errors import UserError
from aerojax.simulate.assets.importers.scene import ImportedScene, Material, Node, Surface
from aerojax.simulate.assets.mesh.polygons import triangulate

_STL_HEADER, _STL_FACET = 84, 50
"""Bytes of a binary STL file before its facets, and of each."""


def load_mesh_file(path: Path) -> ImportedScene:
    """Read a `.stl` or `.ply` as one still surface; vertex colours are sRGB, as scanners and MeshLab write them.

    Raises:
        UserError: the file is damaged, declares other sizes than it has, or holds no faces.
    """
    data, kind = path.read_bytes(), path.suffix.lower()[1:]
    if kind == "stl" and b"facet" not in data[:4096]:
        declared = int.from_bytes(data[_STL_HEADER - 4 : _STL_HEADER], "little")
        if len(data) != _STL_HEADER + _STL_FACET * declared:
            raise UserError("unreadable", f"{path}: its {declared} facets are not in the file", "export it again")
    try:
        mesh = trimesh.load_mesh(io.BytesIO(data), file_type=kind, process=False, fix_texture=False)
        points, corners, counts = _polygons(mesh)
    except Exception as error:  # its parsers raise whatever damaged bytes lead to
        raise UserError(
            "unreadable", f"{path}: cannot be read as {kind.upper()} ({error})", "export it again"
        ) from error
    if not len(corners):  # no face, or none with a corner
        raise UserError("missing", f"{path}: holds no faces", "export the model as a mesh")
    if corners.min() < 0 or corners.max() >= len(points) or not np.isfinite(points).all():
        raise UserError("invalid", f"{path}: a face names no vertex, or a vertex is not finite", "export it again")
    rows, _ = triangulate(points, counts, corners)
    colours = _colours(mesh, len(points))
    material = Material() if colours is None else Material(colour=(1.0, 1.0, 1.0))
    surface = Surface(points.astype(np.float32), corners[rows], material, colours=colours)
    return ImportedScene((Node("model", surfaces=(surface,)),))


def _polygons(mesh: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points, and corners of all faces one after the other with their numbers.

    Raises:
        ValueError: a PLY file's elements are not as many as it declares.
    """
    raw = mesh.metadata.get("_ply_raw")
    if raw is None:
        faces = np.asarray(mesh.faces, np.int64).reshape(-1, 3)
        return np.asarray(mesh.vertices, np.float64), faces.reshape(-1), np.full(len(faces), 3)
    vertex, face = raw["vertex"], raw.get("face", {"length": 0, "data": {}})
    points = np.stack([np.asarray(vertex["data"][axis], np.float64).reshape(-1) for axis in "xyz"], axis=1)
    held = face["data"]  # arrays by name, or one structured array
    known = held if isinstance(held, dict) else held.dtype.names
    lists: Any = next((held[n] for n in ("vertex_indices", "vertex_index") if n in known), [])
    lists = lists["f1"] if getattr(lists, "dtype", None) is not None and lists.dtype.names else lists
    polygons = [np.asarray(polygon, np.int64).reshape(-1) for polygon in lists]
    if len(points) != vertex["length"] or len(polygons) != face["length"]:
        raise ValueError(f"{vertex['length']} vertices and {face['length']} faces are declared, not held")
    counts = np.array([len(polygon) for polygon in polygons], np.int64)
    return points, np.concatenate([np.zeros(0, np.int64), *polygons]), counts


def _colours(mesh: Any, count: int) -> Float[np.ndarray, "vertex 3"] | None:
    if mesh.visual.kind != "vertex" or len(mesh.visual.vertex_colors) != count:
        return None
    return linear_from_srgb(np.asarray(mesh.visual.vertex_colors, np.float64)[:, :3] / 255.0).astype(np.float32)
