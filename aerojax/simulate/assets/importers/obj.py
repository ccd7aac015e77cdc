"""Wavefront OBJ files with their materials as imported scenes."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from aerojax.core.errors import UserError
from aerojax.simulate.assets.importers.scene import ImportedScene, Material, Node, Surface

Corner = tuple[int, int, int]
"""Rows of a corner's position, texture coordinate and normal; -1 for none."""


@dataclass
class _Reading:
    """What has been read so far; faces are kept by object and material."""

    path: Path
    points: list[list[float]] = field(default_factory=list)
    st: list[list[float]] = field(default_factory=list)
    normals: list[list[float]] = field(default_factory=list)
    faces: dict[tuple[str, str], list[tuple[Corner, Corner, Corner]]] = field(default_factory=dict)
    materials: dict[str, Material] = field(default_factory=dict)
    textures: list[bytes] = field(default_factory=list)


def load_wavefront(path: Path) -> ImportedScene:
    """Read an OBJ file: polygons become fans, objects and groups become nodes; lines, points and curves are left out.

    Raises:
        UserError: if a line or a number in it is not understood, or a material library or a texture is missing.
    """
    reading, part, material = _Reading(path), "model", ""
    for number, line in enumerate(path.read_text(encoding="utf-8", errors="replace").splitlines(), start=1):
        word, _, rest = line.strip().partition(" ")
        try:
            if word in ("o", "g"):
                part = rest.strip() or "model"
            elif word == "usemtl":
                material = rest.strip()
            elif word == "mtllib":
                _read_library(reading, path.parent / rest.strip())
            elif word == "f":
                reading.faces.setdefault((part, material), []).extend(_fan(reading, rest.split()))
            elif word in ("v", "vt", "vn"):
                {"v": reading.points, "vt": reading.st, "vn": reading.normals}[word].append([*map(float, rest.split())])
        except (ValueError, IndexError) as error:
            if isinstance(error, UserError):
                raise
            raise UserError(
                "unreadable", f"{path}: line {number} is not understood ({line.strip()!r})", "export it again"
            ) from error
    if not reading.faces:
        raise UserError("missing", f"{path}: holds no faces", "export the model as a mesh")
    parts = dict.fromkeys(name for name, _ in reading.faces)
    nodes = tuple(
        Node(name, surfaces=tuple(_surface(reading, *key) for key in reading.faces if key[0] == name)) for name in parts
    )
    return ImportedScene(nodes, textures=tuple(reading.textures))


def _fan(reading: _Reading, words: list[str]) -> list[tuple[Corner, Corner, Corner]]:
    corners = [_corner(reading, word) for word in words]
    return [(corners[0], corners[k], corners[k + 1]) for k in range(1, len(corners) - 1)]


def _corner(reading: _Reading, word: str) -> Corner:
    """`v`, `v/t`, `v//n` or `v/t/n`; rows count from 1, or backwards from the last one read."""
    given = [*word.split("/"), "", ""]
    rows = []
    for text, table in zip(given, (reading.points, reading.st, reading.normals), strict=False):
        row = (int(text) - 1 if int(text) > 0 else len(table) + int(text)) if text else -1
        if text and not 0 <= row < len(table):
            raise IndexError(word)
        rows.append(row)
    return rows[0], rows[1], rows[2]


def _surface(reading: _Reading, part: str, material: str) -> Surface:
    """Triangles of one object and material; corners that agree in everything share a vertex."""
    corners = np.array(reading.faces[part, material], np.int64).reshape(-1, 3)
    rows, index = np.unique(corners, axis=0, return_inverse=True)
    points = np.array([reading.points[i] for i in rows[:, 0]], np.float64)
    textured, smooth = (rows[:, 1] >= 0).all(), (rows[:, 2] >= 0).all()
    return Surface(
        points=points[:, :3].astype(np.float32),
        faces=index.reshape(-1, 3),
        material=reading.materials.get(material, Material()),
        normals=np.array([reading.normals[i] for i in rows[:, 2]], np.float32) if smooth else None,
        st=np.array([reading.st[i][:2] for i in rows[:, 1]], np.float32) if textured else None,
        colours=points[:, 3:6].astype(np.float32) if points.shape[1] >= 6 else None,
    )


def _read_library(reading: _Reading, path: Path) -> None:
    """Materials of an MTL file: Kd (linear), d or Tr, Ns or Pr, Pm and map_Kd."""
    if not path.is_file():
        raise UserError(
            "missing", f"{reading.path}: its material library {path.name} is missing", "keep it beside the model"
        )
    name = ""
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
        word, _, rest = line.strip().partition(" ")
        if word == "newmtl":
            name = rest.strip()
            reading.materials[name] = Material(name=name)
        elif name:
            reading.materials[name] = _with(reading, reading.materials[name], word, rest.split(), path)


def _with(reading: _Reading, material: Material, word: str, values: list[str], library: Path) -> Material:
    """The material with one more statement."""
    if word == "Kd":
        red, green, blue = map(float, values[:3])
        return replace(material, colour=(red, green, blue))
    if word in ("d", "Tr"):
        opacity = float(values[-1]) if word == "d" else 1.0 - float(values[-1])
        return replace(material, opacity=opacity)
    if word == "Ns":  # Blinn's exponent n as a microfacet width sqrt(2 / (n + 2)), which is roughness squared
        return replace(material, roughness=float((2.0 / (float(values[0]) + 2.0)) ** 0.25))
    if word == "Pr":
        return replace(material, roughness=float(values[0]))
    if word == "Pm":
        return replace(material, metallic=float(values[0]))
    if word == "map_Kd":
        texture = library.parent / values[-1].replace("\\", "/")
        if not texture.is_file():
            raise UserError(
                "missing", f"{library}: map_Kd names {values[-1]}, which is missing", "keep it beside the library"
            )
        reading.textures.append(texture.read_bytes())
        return replace(material, texture=len(reading.textures) - 1)
    return material
