"""Closed triangle meshes: boxes, tubes, ellipsoids and rings, and the operations that place them.

Points are metres in the frame of the caller; every solid is watertight and wound so that its normals point outwards.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float, Int

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Mesh:
    """Triangles that index points; counter-clockwise seen from outside."""

    points: Float[np.ndarray, "vertex 3"]
    faces: Int[np.ndarray, "face 3"]


def merge(*meshes: Mesh) -> Mesh:
    """Put meshes side by side in one; points are not welded, so closed parts stay closed."""
    offsets = np.cumsum([0] + [len(m.points) for m in meshes[:-1]])
    points = np.concatenate([m.points for m in meshes])
    return Mesh(points, np.concatenate([m.faces + o for m, o in zip(meshes, offsets, strict=True)]))


def moved(mesh: Mesh, offset: Vector, rotation: Float[np.ndarray, "3 3"] | None = None) -> Mesh:
    """Rotate a mesh about the origin, then shift it by `offset` (metres)."""
    points = mesh.points if rotation is None else mesh.points @ rotation.T
    return Mesh(points + np.asarray(offset, float), mesh.faces)


def scaled(mesh: Mesh, factor: float) -> Mesh:
    """Scale a mesh about the origin."""
    return Mesh(mesh.points * factor, mesh.faces)


def mirrored(mesh: Mesh) -> Mesh:
    """Mirror a mesh in the plane y = 0 and keep its winding outward."""
    return Mesh(mesh.points * np.array([1.0, -1.0, 1.0]), mesh.faces[:, ::-1].copy())


def both_sides(mesh: Mesh) -> Mesh:
    """A left part (+y) and its mirror image."""
    return merge(mesh, mirrored(mesh))


def rotation_about(axis: Vector, degrees: float) -> Float[np.ndarray, "3 3"]:
    """Rotation matrix by Rodrigues' formula; `axis` need not be unit."""
    x, y, z = np.asarray(axis, float) / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = np.deg2rad(degrees)
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def frame_along(direction: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 3"]:
    """A rotation whose third column is `direction`; the other two are any right-handed completion."""
    w = direction / np.linalg.norm(direction)
    seed = np.eye(3)[np.argmin(np.abs(w))]
    u = np.cross(seed, w)
    u /= np.linalg.norm(u)
    return np.stack([u, np.cross(w, u), w], axis=1)


def outward(mesh: Mesh) -> Mesh:
    """Flip a closed mesh whose signed volume is negative."""
    a, b, c = (mesh.points[mesh.faces[:, i]] for i in range(3))
    volume = np.einsum("ij,ij->", a, np.cross(b, c))
    return mesh if volume >= 0 else Mesh(mesh.points, mesh.faces[:, ::-1].copy())


def loft(sections: Float[np.ndarray, "section ring 3"]) -> Mesh:
    """Skin closed rings into a solid and cap both ends.

    The ring's point i faces point ring-1-i across the section (upper against lower surface), so that a cap is a strip
    of quadrilaterals and stays inside thin, cambered outlines where a fan would not.
    """
    count, ring = sections.shape[:2]
    i, j = np.arange(count - 1)[:, None] * ring, np.arange(ring)[None, :]
    k = (j + 1) % ring
    a, b, c, d = i + j, i + k, i + ring + k, i + ring + j
    sides = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    m = np.arange(ring // 2 - 1)
    lower = ring - 1 - m
    cap = np.concatenate([np.stack([m, lower, lower - 1], -1), np.stack([m, lower - 1, m + 1], -1)])
    faces = np.concatenate([sides, cap, cap[:, ::-1] + (count - 1) * ring])
    return outward(Mesh(sections.reshape(-1, 3), faces))


def box(centre: Vector, size: Vector) -> Mesh:
    """An axis-aligned box; `size` is its full extent."""
    half = np.asarray(size, float) / 2
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], float)
    ends = [np.concatenate([np.full((4, 1), x), corners], axis=1) for x in (-1.0, 1.0)]
    return moved(loft(np.stack(ends) * half), centre)


def tube(start: Vector, end: Vector, radius: float, end_radius: float | None = None, sides: int = 10) -> Mesh:
    """A capped cylinder or cone frustum between two points; `sides` is even."""
    first, last = np.asarray(start, float), np.asarray(end, float)
    frame = frame_along(last - first)
    angle = 2 * np.pi * (np.arange(sides) + 0.5) / sides
    circle = np.stack([np.cos(angle), np.sin(angle), np.zeros(sides)], axis=1) @ frame.T
    return loft(np.stack([first + radius * circle, last + (end_radius or radius) * circle]))


def polyline_tube(points: list[Vector], radius: float, sides: int = 8) -> Mesh:
    """Tubes along a chain of points, overlapping at the corners."""
    return merge(*(tube(a, b, radius, sides=sides) for a, b in pairwise(points)))


def ellipsoid(centre: Vector, radii: Vector, rings: int = 9, sides: int = 14) -> Mesh:
    """An ellipsoid with its poles on x; the poles are discs of a hundredth of the radius."""
    latitude = np.linspace(0.01, np.pi - 0.01, rings)
    angle = 2 * np.pi * (np.arange(sides) + 0.5) / sides
    x = np.broadcast_to(np.cos(latitude)[:, None], (rings, sides))
    y, z = np.sin(latitude)[:, None] * np.cos(angle), np.sin(latitude)[:, None] * np.sin(angle)
    return moved(loft(np.stack([x, y, z], axis=-1) * np.asarray(radii, float)), centre)


def ring(centre: Vector, radius: float, height: float, thickness: float, sides: int = 24) -> Mesh:
    """A hollow cylinder about z (a duct or a guard): mean radius, full height, wall thickness."""
    profile = np.array([[1, -1], [1, 1], [-1, 1], [-1, -1]]) * np.array([thickness / 2, height / 2])
    angle = 2 * np.pi * np.arange(sides) / sides
    r, z = profile[:, 0] + radius, np.broadcast_to(profile[:, 1], (sides, 4))
    points = np.stack([r * np.cos(angle)[:, None], r * np.sin(angle)[:, None], z], axis=-1).reshape(-1, 3)
    i, j = np.arange(sides)[:, None] * 4, np.arange(4)[None, :]
    n, k = (i + 4) % (4 * sides), (j + 1) % 4
    a, b, c, d = i + j, n + j, n + k, i + k
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    return moved(outward(Mesh(points, faces)), centre)


def hoop(centre: Vector, axis: Vector, radius: float, thickness: float, sides: int = 24) -> Mesh:
    """A ring of square section about any axis through its centre."""
    flat = ring((0.0, 0.0, 0.0), radius, thickness, thickness, sides)
    return moved(flat, centre, frame_along(np.asarray(axis, float)))
