"""Thin and lumpy solids that outliers are made of: leaves, sails, bags, ribbons."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from aerojax.simulate.assets.mesh.shapes import Mesh, Vector, both_sides, ellipsoid, loft, outward, polyline_tube

THIN = 0.006
"""Metres: half the thickness of a sheet of one metre; thinner ones vanish between the rays."""


def half_sheet(
    x: Float[np.ndarray, "station"], width: Float[np.ndarray, "station"], *, fold: float, bend: float, twist: float
) -> Mesh:
    """The left half of a sheet along x, from its midrib (y = 0) to its edge.

    Args:
        x: stations, metres, increasing.
        width: from the midrib to the edge there, metres, above 0.
        fold: slope by which both halves rise from the midrib.
        bend: curvature of the midrib, one over metres.
        twist: turn about the midrib, radians a metre.
    """
    share = np.linspace(0.0, 1.0, 4)
    y, along = width[:, None] * share, np.broadcast_to(x[:, None], (len(x), len(share)))
    upper = np.stack([along, y, fold * y + THIN], axis=2)
    lower = np.stack([along, y, fold * y - THIN], axis=2)[:, ::-1]
    points = np.concatenate([upper, lower], axis=1).reshape(-1, 3)
    mesh = loft(points.reshape(len(x), -1, 3))
    return outward(Mesh(_curved(mesh.points, bend, twist), mesh.faces))


def sheet(
    x: Float[np.ndarray, "station"], width: Float[np.ndarray, "station"], *, fold: float, bend: float, twist: float
) -> Mesh:
    """Both halves, arguments as for `half_sheet`; only a twist makes them differ."""
    whole = both_sides(half_sheet(x, width, fold=fold, bend=bend, twist=0.0))
    return Mesh(_curved(whole.points, 0.0, twist), whole.faces)


def _curved(points: Float[np.ndarray, "vertex 3"], bend: float, twist: float) -> Float[np.ndarray, "vertex 3"]:
    x, y, z = points.T
    c, s = np.cos(twist * x), np.sin(twist * x)
    return np.stack([x, c * y - s * z, s * y + c * z + bend * x * x], axis=1)


def lump(radii: Vector, waves: int, strength: float, rng: np.random.Generator) -> Mesh:
    """An ellipsoid whose radius swells and shrinks by random waves.

    Args:
        radii: metres.
        waves: how many are added.
        strength: standard deviation of the radius' logarithm, about.
        rng: of directions and phases.
    """
    mesh = ellipsoid((0.0, 0.0, 0.0), radii, 25, 30)
    total = np.zeros(len(mesh.points))
    for _ in range(waves):
        total += np.sin(mesh.points @ rng.normal(0.0, 6.0, 3) + rng.uniform(0.0, 2 * np.pi))
    factor = np.exp(strength * np.sqrt(2.0 / waves) * total)
    return outward(Mesh(mesh.points * factor[:, None], mesh.faces))


def wavy_line(start: Vector, end: Vector, sway: float, rng: np.random.Generator, points: int = 9) -> list[Vector]:
    """Points from `start` to `end` that swing aside by about `sway` metres, more towards the end."""
    first, last = np.asarray(start, float), np.asarray(end, float)
    share = np.linspace(0.0, 1.0, points)[:, None]
    turns, phase = rng.uniform(0.5, 2.0, 3), rng.uniform(0.0, 2 * np.pi, 3)
    aside = sway * share * (np.sin(2 * np.pi * turns * share + phase) - np.sin(phase))
    return [(float(x), float(y), float(z)) for x, y, z in first + share * (last - first) + aside]


def cord(points: Sequence[Vector], radius: float) -> Mesh:
    """A string or ribbon along points."""
    return polyline_tube(list(points), radius, sides=6)
