"""Wavefront OBJ files with their materials as imported scenes.

Read here and not with trimesh, which fans concave faces, drops vertex colours that not every vertex has, and reads no
names with blanks.
"""

from __future__ import annotations

import shlex
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Float

from aerojax.core.errors import UserError
from aerojax.simulate.assets.importers.beside import find_beside
from aerojax.simulate.assets.importers.mtl import Paint, Palette, numbers, read_library, statements, understood
from aerojax.simulate.assets.importers.scene import ImportedScene, Material, Node, Surface
from aerojax.simulate.assets.mesh.polygons import triangulate

Corner = tuple[int, int, int]
"""Rows of a corner's position, texture coordinate and normal; -1 for none."""
_PLAIN, _WHITE = Paint(Material()), Paint(Material(colour=(1.0, 1.0, 1.0)))


@dataclass
class _Reading:
    """What has been read so far; polygons are kept by object and material. Colours are by row of `points`."""

    path: Path
    points: list[list[float]] = field(default_factory=list)
    colours: dict[int, list[float]] = field(default_factory=dict)
    st: list[list[float]] = field(default_factory=list)
    normals: list[list[float]] = field(default_factory=list)
    faces: dict[tuple[str, str], list[list[Corner]]] = field(default_factory=dict)
    palette: Palette = field(default_factory=Palette)
    part: str = "model"
    material: str = ""


def load_wavefront(path: Path) -> ImportedScene:
    """Read an OBJ file: objects and groups become nodes; lines, points and curves are left out.

    Concave polygons are clipped ear by ear. Vertices without a colour beside others that have one are white; colours
    above 1 are out of 255.

    Raises:
        UserError: if a line or a number in it is not understood, or a material library or a texture is missing.
    """
    reading = _Reading(path)
    for number, word, rest in statements(path):
        with understood(path, number, word, rest):
            _read_statement(reading, word, rest)
    if not reading.faces:
        raise UserError("missing", f"{path}: holds no faces", "export the model as a mesh")
    parts = dict.fromkeys(name for name, _ in reading.faces)
    nodes = tuple(
        Node(name, surfaces=tuple(_surface(reading, *key) for key in reading.faces if key[0] == name)) for name in parts
    )
    return ImportedScene(nodes, textures=tuple(reading.palette.textures))


def _read_statement(reading: _Reading, word: str, rest: str) -> None:
    if word in ("o", "g"):
        reading.part = rest or "model"
    elif word == "usemtl":
        reading.material = rest
    elif word == "mtllib":
        for library in _libraries(reading.path, rest):
            read_library(library, reading.palette)
    elif word == "f":
        corners = [_corner(reading, text) for text in rest.partition("#")[0].split()]
        if len(corners) > 2:
            reading.faces.setdefault((reading.part, reading.material), []).append(corners)
    elif word == "v":
        values = numbers(rest)
        if len(values) >= 6:  # with a seventh number it is x y z r g b a
            reading.colours[len(reading.points)] = values[3:6]
        x, y, z = values[:3]
        reading.points.append([x, y, z])
    elif word == "vt":
        u, v = (*numbers(rest), 0.0)[:2]
        reading.st.append([u, v])
    elif word == "vn":
        x, y, z = map(float, rest.partition("#")[0].split())
        reading.normals.append([x, y, z])


def _libraries(path: Path, rest: str) -> list[Path]:
    """Files of an `mtllib`: one name, perhaps with blanks, or several."""
    if whole := find_beside(path.parent, rest):
        return [whole]
    names = shlex.split(rest.replace("\\", "/"))
    found = [find_beside(path.parent, name) for name in names]
    missing = [name for name, file in zip(names, found, strict=True) if file is None] if len(names) > 1 else [rest]
    if missing:
        raise UserError(
            "missing", f"{path}: its material library {', '.join(missing)} is missing", "keep it beside the model"
        )
    return [file for file in found if file is not None]


def _corner(reading: _Reading, word: str) -> Corner:
    """`v`, `v/t`, `v//n` or `v/t/n`; rows count from 1, or backwards from the last one read."""
    given = [*word.split("/"), "", ""]
    rows = []
    for text, table in zip(given, (reading.points, reading.st, reading.normals), strict=False):
        row = (int(text) - 1 if int(text) > 0 else len(table) + int(text)) if text else -1
        if text and not 0 <= row < len(table):
            raise IndexError(word)
        rows.append(row)
    if rows[0] < 0:
        raise IndexError(word)
    return rows[0], rows[1], rows[2]


def _surface(reading: _Reading, part: str, material: str) -> Surface:
    """Triangles of one object and material; corners that agree in everything share a vertex."""
    polygons = reading.faces[part, material]
    corners = np.array([corner for polygon in polygons for corner in polygon], np.int64).reshape(-1, 3)
    rows, index = np.unique(corners, axis=0, return_inverse=True)
    index = index.reshape(-1)
    points = np.array([reading.points[i] for i in rows[:, 0]], np.float64)
    colours = _colours(reading, rows[:, 0].tolist())
    paint = reading.palette.paints.get(material, _PLAIN if colours is None else _WHITE)
    triangles, _ = triangulate(points, np.array([len(p) for p in polygons], np.int64), index)
    textured, smooth = (rows[:, 1] >= 0).all(), (rows[:, 2] >= 0).all()
    st = np.array([reading.st[i] for i in rows[:, 1]]) * paint.scale + paint.offset if textured else None
    return Surface(
        points=points.astype(np.float32),
        faces=index[triangles],
        material=paint.material,
        normals=np.array([reading.normals[i] for i in rows[:, 2]], np.float32) if smooth else None,
        st=None if st is None else st.astype(np.float32),
        colours=colours,
    )


def _colours(reading: _Reading, rows: list[int]) -> Float[np.ndarray, "vertex 3"] | None:
    if not any(row in reading.colours for row in rows):
        return None
    most = max(max(colour) for colour in reading.colours.values())
    whole = 255.0 if most > 1.0 else 1.0
    white = [whole] * 3
    return np.array([reading.colours.get(row, white) for row in rows], np.float32) / np.float32(whole)
