"""Ten kinds of things of about one metre, upright (+Z up) and with random proportions."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from aerojax.simulate.assets.mesh.shapes import Mesh, Vector, box, ellipsoid, hoop, merge, tube

CENTRE: Vector = (0.0, 0.0, 0.0)
UP: Vector = (0.0, 0.0, 1.0)


def _between(rng: np.random.Generator, low: float, high: float) -> float:
    return float(rng.uniform(low, high))


def _arch(rng: np.random.Generator) -> Mesh:
    """Two pillars with a beam across."""
    width, depth, height = 1.0, _between(rng, 0.2, 0.6), _between(rng, 0.7, 1.3)
    leg, beam = _between(rng, 0.12, 0.25), _between(rng, 0.12, 0.3)
    across = (width - leg) / 2
    pillars = (box((side * across, 0.0, (height - beam) / 2), (leg, depth, height - beam)) for side in (-1, 1))
    return merge(*pillars, box((0.0, 0.0, height - beam / 2), (width, depth, beam)))


def _ball(rng: np.random.Generator) -> Mesh:
    return ellipsoid(CENTRE, (0.5, _between(rng, 0.35, 0.5), _between(rng, 0.35, 0.5)), rings=25, sides=32)


def _block(rng: np.random.Generator) -> Mesh:
    return box(CENTRE, (1.0, _between(rng, 0.4, 1.0), _between(rng, 0.4, 1.2)))


def _legs(width: float, depth: float, height: float, thick: float) -> list[Mesh]:
    """Four legs below the corners of a board whose middle is over the origin."""
    x, y = (width - thick) / 2, (depth - thick) / 2
    return [box((a * x, b * y, height / 2), (thick, thick, height)) for a in (-1, 1) for b in (-1, 1)]


def _chair(rng: np.random.Generator) -> Mesh:
    """A seat on four legs with a back."""
    width, depth = _between(rng, 0.4, 0.6), _between(rng, 0.4, 0.6)
    height, back, board = _between(rng, 0.4, 0.55), _between(rng, 0.4, 0.6), _between(rng, 0.04, 0.08)
    seat = box((0.0, 0.0, height), (width, depth, board))
    rest = box(((board - width) / 2, 0.0, height + back / 2), (board, depth, back))
    return merge(seat, rest, *_legs(width, depth, height, _between(rng, 0.04, 0.07)))


def _cone(rng: np.random.Generator) -> Mesh:
    return tube(
        CENTRE, (0.0, 0.0, _between(rng, 0.7, 1.3)), _between(rng, 0.3, 0.5), _between(rng, 0.01, 0.08), sides=32
    )


def _cross(rng: np.random.Generator) -> Mesh:
    """An upright bar with one across."""
    thick, height, wide = _between(rng, 0.1, 0.22), _between(rng, 0.8, 1.2), _between(rng, 0.5, 0.9)
    bar = box((0.0, 0.0, height * _between(rng, 0.55, 0.8)), (wide, thick, thick))
    return merge(box((0.0, 0.0, height / 2), (thick, thick, height)), bar)


def _cylinder(rng: np.random.Generator) -> Mesh:
    return tube(CENTRE, (0.0, 0.0, _between(rng, 0.5, 1.3)), _between(rng, 0.2, 0.45), sides=32)


def _ring(rng: np.random.Generator) -> Mesh:
    """A lying ring of square section."""
    return hoop(CENTRE, UP, _between(rng, 0.35, 0.5), _between(rng, 0.08, 0.22), sides=40)


def _stairs(rng: np.random.Generator) -> Mesh:
    steps, width, rise = int(rng.integers(3, 7)), _between(rng, 0.4, 0.9), _between(rng, 0.6, 1.1)
    run = 1.0 / steps
    return merge(
        *(
            box(((i + 0.5) * run, 0.0, rise * (i + 1) / steps / 2), (run, width, rise * (i + 1) / steps))
            for i in range(steps)
        )
    )


def _table(rng: np.random.Generator) -> Mesh:
    """A board on four legs."""
    width, depth, height = _between(rng, 0.8, 1.2), _between(rng, 0.5, 1.0), _between(rng, 0.4, 0.75)
    board = box((0.0, 0.0, height), (width, depth, _between(rng, 0.04, 0.08)))
    return merge(board, *_legs(width, depth, height, _between(rng, 0.04, 0.08)))


KINDS: dict[str, Callable[[np.random.Generator], Mesh]] = {
    "arch": _arch,
    "ball": _ball,
    "block": _block,
    "chair": _chair,
    "cone": _cone,
    "cross": _cross,
    "cylinder": _cylinder,
    "ring": _ring,
    "stairs": _stairs,
    "table": _table,
}
"""By class name, in the order of the classes' numbers."""
SHAPES_10 = tuple(KINDS)
