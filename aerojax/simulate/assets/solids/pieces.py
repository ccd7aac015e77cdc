"""Single pieces of random shape, about one metre long: blocks, rods, bodies, wings, rings, propellers and others."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from aerojax.simulate.assets.mesh.lofts import body, trapezoid
from aerojax.simulate.assets.mesh.shapes import (
    Mesh,
    Vector,
    box,
    ellipsoid,
    hoop,
    merge,
    moved,
    outward,
    polyline_tube,
    ring,
    rotation_about,
    tube,
)

CENTRE: Vector = (0.0, 0.0, 0.0)


def _log(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _block(rng: np.random.Generator) -> Mesh:
    return box(CENTRE, (1.0, _log(rng, 0.1, 1.0), _log(rng, 0.1, 1.0)))


def _plate(rng: np.random.Generator) -> Mesh:
    return box(CENTRE, (1.0, _log(rng, 0.15, 1.0), _log(rng, 0.01, 0.05)))


def _rod(rng: np.random.Generator) -> Mesh:
    return tube((-0.5, 0.0, 0.0), (0.5, 0.0, 0.0), _log(rng, 0.008, 0.06))


def _cone(rng: np.random.Generator) -> Mesh:
    wide = _log(rng, 0.06, 0.4)
    return tube((-0.5, 0.0, 0.0), (0.5, 0.0, 0.0), wide, wide * float(rng.uniform(0.05, 1.0)), sides=16)


def _ball(rng: np.random.Generator) -> Mesh:
    return ellipsoid(CENTRE, (0.5, _log(rng, 0.08, 0.5), _log(rng, 0.08, 0.5)), 13, 20)


def _body(rng: np.random.Generator) -> Mesh:
    """A loft through random sections, its back bone bent."""
    count = int(rng.integers(3, 7))
    x = np.linspace(-0.5, 0.5, count)
    width, height = (_log(rng, 0.05, 0.3) * np.exp(rng.uniform(-0.8, 0.3, count)) for _ in range(2))
    ends = np.ones(count)
    ends[[0, -1]] = rng.uniform(0.03, 0.6, 2)
    rise = rng.normal(0.0, 0.08, count)
    sections = np.stack([x, width * ends, height * ends, rise], axis=1).tolist()
    keys = [(a, b, c, d) for a, b, c, d in sections]
    return body(keys, exponent=float(rng.uniform(1.6, 5.0)), power=float(rng.uniform(1.0, 2.0)))


def _wing(rng: np.random.Generator) -> Mesh:
    chord, swept = _log(rng, 0.08, 0.5), float(rng.uniform(-0.5, 0.2))
    tip = (swept, 1.0, float(rng.uniform(-0.2, 0.3)))
    wing = trapezoid(CENTRE, tip, chord, chord * float(rng.uniform(0.2, 1.0)), float(rng.uniform(0.05, 0.18)))
    return moved(wing, (chord / 2, -0.5, 0.0))


def _ring(rng: np.random.Generator) -> Mesh:
    if rng.random() < 0.5:
        return ring(CENTRE, 0.45, _log(rng, 0.02, 0.4), _log(rng, 0.01, 0.1))
    return hoop(CENTRE, (1.0, 0.0, 0.0), 0.45, _log(rng, 0.015, 0.15))


def _bent(rng: np.random.Generator) -> Mesh:
    """A tube along a random chain of points."""
    steps = rng.normal(0.0, 0.35, (int(rng.integers(2, 5)), 3)) + np.array([0.25, 0.0, 0.0])
    points = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
    return polyline_tube([(float(x), float(y), float(z)) for x, y, z in points], _log(rng, 0.01, 0.06))


def _propeller(rng: np.random.Generator) -> Mesh:
    """Blades about an axis."""
    count, width = int(rng.integers(2, 6)), _log(rng, 0.03, 0.12)
    blade = moved(box((0.25, 0.0, 0.0), (0.5, width, 0.012)), CENTRE, rotation_about((1.0, 0.0, 0.0), 12.0))
    turned = [moved(blade, CENTRE, rotation_about((0.0, 0.0, 1.0), 360.0 * i / count)) for i in range(count)]
    return merge(*turned, tube((0.0, 0.0, -0.04), (0.0, 0.0, 0.04), 0.05))


def _lump(rng: np.random.Generator) -> Mesh:
    """A ball with waves of its radius."""
    mesh = ellipsoid(CENTRE, (0.5, _log(rng, 0.2, 0.5), _log(rng, 0.2, 0.5)), 25, 30)
    total = np.zeros(len(mesh.points))
    for _ in range(6):
        wave = rng.normal(0.0, 5.0, 3)
        total += np.sin(mesh.points @ wave + rng.uniform(0, 2 * np.pi))
    factor = np.exp(float(rng.uniform(0.03, 0.12)) * total)
    return outward(Mesh(mesh.points * factor[:, None], mesh.faces))


PIECES: tuple[Callable[[np.random.Generator], Mesh], ...] = (
    *(_block, _plate, _rod, _cone, _ball, _body),
    *(_wing, _ring, _bent, _propeller, _lump, _body),
)
"""Equally likely; what is named twice is twice as likely."""


def draw_piece(rng: np.random.Generator) -> Mesh:
    """One piece, its middle near the origin."""
    return PIECES[int(rng.integers(len(PIECES)))](rng)
