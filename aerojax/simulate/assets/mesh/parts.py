"""Parts that assets are made of, and the normals of their meshes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from aerojax.simulate.assets.mesh.shapes import Mesh, Vector

CREASE_COSINE = float(np.cos(np.deg2rad(42.0)))
"""Neighbouring faces that turn by less than 42 degrees share a smooth normal."""


@dataclass(frozen=True)
class Spin:
    """A steady rotation: hub in the body frame (metres), axis, rate (negative is clockwise about the axis), phase."""

    hub: Vector
    axis: Vector
    hertz: float
    phase_degrees: float = 0.0


@dataclass(frozen=True)
class Part:
    """One mesh of an asset.

    mesh: a spinning mesh has its hub at its origin.
    role: picks its colour; 0 is the skin, which has all patterns.
    opacity: below 1 for what light passes through, as the disc that a fast rotor blurs into.
    """

    name: str
    mesh: Mesh
    role: int = 0
    spin: Spin | None = None
    opacity: float = 1.0


def face_normals(mesh: Mesh) -> Float[np.ndarray, "face 3"]:
    """Normals scaled by twice the faces' areas."""
    a, b, c = (mesh.points[mesh.faces[:, i]] for i in range(3))
    return np.cross(b - a, c - a)


def corner_normals(mesh: Mesh) -> Float[np.ndarray, "corner 3"]:
    """Unit normals, three a face: the area-weighted mean over the vertex's faces within the crease angle."""
    area_normal = face_normals(mesh)
    unit = area_normal / np.linalg.norm(area_normal, axis=1, keepdims=True).clip(1e-20)
    vertex, face = mesh.faces.reshape(-1), np.repeat(np.arange(len(mesh.faces)), 3)
    order = np.argsort(vertex, kind="stable")
    start = np.searchsorted(vertex[order], np.arange(len(mesh.points) + 1))
    valence = np.diff(start)[vertex]
    one = np.repeat(np.arange(len(vertex)), valence)
    step = np.arange(len(one)) - np.repeat(np.cumsum(valence) - valence, valence)
    other = order[start[vertex[one]] + step]
    near = np.einsum("ij,ij->i", unit[face[one]], unit[face[other]]) > CREASE_COSINE
    total = np.zeros((len(vertex), 3))
    np.add.at(total, one[near], area_normal[face[other[near]]])
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.where(length > 1e-20, total / length.clip(1e-20), unit[face])
