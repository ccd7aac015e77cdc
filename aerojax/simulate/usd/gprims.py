"""UsdGeom's shapes without points of their own (Cube, Sphere, Cylinder, Cone, Capsule, Plane) as triangles."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from pxr import Usd, UsdGeom

from aerojax.core.errors import UserError

AROUND = 64
"""Corners of a circle: the area of its polygon is 0.16 % short, and those on the axes give exact bounds."""
QUARTER = 16
"""Rings of a hemisphere, so that its arcs are as fine as its circles."""

_EDGES = np.array([-0.5, 0.5])
_CUBE = np.stack(np.meshgrid(_EDGES, _EDGES, _EDGES, indexing="ij"), axis=-1).reshape(-1, 3)
_CUBE_QUADS = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
_AXES = {"X": [2, 0, 1], "Y": [1, 2, 0], "Z": [0, 1, 2]}
"""Which of a shape's own x, y, z (its spine along z) come first, second and third along the prim's axes."""
_ROUND = (
    UsdGeom.Sphere,
    UsdGeom.Cylinder,
    UsdGeom.Cylinder_1,
    UsdGeom.Cone,
    UsdGeom.Capsule,
    UsdGeom.Capsule_1,
)
SHAPES = (UsdGeom.Cube, UsdGeom.Plane, *_ROUND)


@dataclass(frozen=True)
class Solid:
    """Triangles of a shape, counter-clockwise seen from outside, and its points at a time code, in the prim's space."""

    faces: Int[np.ndarray, "face 3"]
    points_at: Callable[[float], Float[np.ndarray, "vertex 3"]]
    moves: bool


def solid(prim: Usd.Prim) -> Solid | None:
    """The shape that a prim is; None if it is none of `SHAPES`."""
    if not any(prim.IsA(kind) for kind in SHAPES):
        return None
    numbers = [a for a in prim.GetAttributes() if a.GetName() in _NUMBERS]
    moves = any(a.ValueMightBeTimeVarying() for a in numbers)
    if prim.IsA(UsdGeom.Cube):
        quads = np.array(_CUBE_QUADS)
        faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
        return Solid(faces, lambda time: _CUBE * _length(prim, "size", time), moves)
    if prim.IsA(UsdGeom.Plane):
        return Solid(np.array([[0, 1, 2], [0, 2, 3]]), lambda time: _plane(prim, time), moves)
    sample = _profile(prim, Usd.TimeCode.EarliestTime())
    return Solid(_turned_faces(len(sample)), lambda time: _turned(prim, time), moves)


_NUMBERS = ("size", "radius", "radiusTop", "radiusBottom", "height", "width", "length")


def _length(prim: Usd.Prim, name: str, time: Usd.TimeCode | float) -> float:
    value = prim.GetAttribute(name).Get(time)
    if value is None or not 0 <= value < np.inf:
        raise UserError("invalid", f"{prim.GetPath()}: {name} is {value}", "give a length that is not negative")
    return float(value)


def _plane(prim: Usd.Prim, time: Usd.TimeCode | float) -> Float[np.ndarray, "4 3"]:
    """`width` lies along x (z where the axis is X), `length` along y (z where the axis is Y)."""
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) / 2
    axis, width, length = _axis(prim), _length(prim, "width", time), _length(prim, "length", time)
    if axis == "Z":
        return corners * [width, length, 0]
    if axis == "X":  # the first coordinate runs along -z, so that the front looks along +x
        return (corners * [width, length, 0])[:, [2, 1, 0]] * [1, 1, -1]
    return (corners * [width, length, 0])[:, [0, 2, 1]] * [1, 1, -1]


def _axis(prim: Usd.Prim) -> str:
    axis = str(prim.GetAttribute("axis").Get() or "Z") if prim.GetAttribute("axis") else "Z"
    if axis not in _AXES:
        raise UserError("invalid", f"{prim.GetPath()}: axis is {axis}", "use X, Y or Z")
    return axis


def _profile(prim: Usd.Prim, time: Usd.TimeCode | float) -> Float[np.ndarray, "ring 2"]:
    """Radius and height of each ring of a solid of revolution, from the lowest to the highest point of its spine."""
    if prim.IsA(UsdGeom.Sphere):
        return _arc(-2 * QUARTER, 2 * QUARTER) * _length(prim, "radius", time)
    half = _length(prim, "height", time) / 2
    two = prim.IsA(UsdGeom.Cylinder_1) or prim.IsA(UsdGeom.Capsule_1)
    low = _length(prim, "radiusBottom" if two else "radius", time)
    high = _length(prim, "radiusTop" if two else "radius", time)
    if prim.IsA(UsdGeom.Cone):
        return np.array([[0, -half], [low, -half], [0, half]])
    if prim.IsA(UsdGeom.Capsule) or prim.IsA(UsdGeom.Capsule_1):
        return np.concatenate([_arc(-2 * QUARTER, 0) * low - [0, half], _arc(0, 2 * QUARTER) * high + [0, half]])
    return np.array([[0, -half], [low, -half], [high, half], [0, half]])


def _arc(first: int, last: int) -> Float[np.ndarray, "ring 2"]:
    """Points of the unit half circle between two multiples of a sixty-fourth turn; poles lie on the spine exactly."""
    angle = np.arange(first, last + 1) * (np.pi / (4 * QUARTER))
    rings = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    rings[np.abs(rings) < 1e-12] = 0.0
    return rings


def _turned(prim: Usd.Prim, time: Usd.TimeCode | float) -> Float[np.ndarray, "vertex 3"]:
    """A profile turned about the spine; its two ends are single vertices on it."""
    rings = _profile(prim, time)
    angle = np.arange(AROUND) * (2 * np.pi / AROUND)
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1).round(15)
    inner = rings[1:-1]
    sides = np.concatenate(
        [inner[:, None, :1] * circle, np.broadcast_to(inner[:, None, 1:], (len(inner), AROUND, 1))], axis=2
    )
    ends = np.array([[0, 0, rings[0, 1]], [0, 0, rings[-1, 1]]])
    points = np.concatenate([ends[:1], sides.reshape(-1, 3), ends[1:]])
    return points[:, _AXES[_axis(prim)]] if not prim.IsA(UsdGeom.Sphere) else points


def _turned_faces(rings: int) -> Int[np.ndarray, "face 3"]:
    """Triangles of a turned profile of so many rings, its ends among them."""
    here, after = np.arange(AROUND), (np.arange(AROUND) + 1) % AROUND
    top = 1 + (rings - 2) * AROUND
    low = np.stack([np.zeros(AROUND, np.int64), 1 + after, 1 + here], axis=1)
    high = np.stack([np.full(AROUND, top), top - AROUND + here, top - AROUND + after], axis=1)
    bands = [low]
    for k in range(rings - 3):
        one, two = 1 + k * AROUND, 1 + (k + 1) * AROUND
        bands.append(np.stack([one + here, one + after, two + after], axis=1))
        bands.append(np.stack([one + here, two + after, two + here], axis=1))
    return np.concatenate([*bands, high])
