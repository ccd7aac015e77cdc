"""Kinds of outliers: how each is drawn, how it moves, and what it is for.

Those of `val` choose scores and levels, those of `test` alone measure them, so that a kind in a test is one that nobody
has looked at before. None of them is in the data set or in training.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from aerojax.simulate.assets.mesh.lofts import body
from aerojax.simulate.assets.mesh.shapes import Mesh, Vector, box, ellipsoid, hoop, merge, moved, rotation_about, tube
from aerojax.simulate.assets.outliers.sheets import THIN, cord, lump, sheet, wavy_line

Drift = Literal["thrown", "drifting", "fluttering", "tethered", "spinning"]
"""How a thing moves that does not fly by itself; see `world.passive_flight`."""
CENTRE: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class OutlierKind:
    """One kind.

    draw: an individual's mesh, of any size; the body's nose is +X, its upper side +Z.
    drift: how it moves.
    split: what it is for.
    """

    draw: Callable[[np.random.Generator], Mesh]
    drift: Drift
    split: Literal["val", "test"]


def _between(rng: np.random.Generator, low: float, high: float) -> float:
    return float(rng.uniform(low, high))


def _log(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _ball(rng: np.random.Generator) -> Mesh:
    """Round, or as long as a rugby ball."""
    across = _between(rng, 0.28, 0.36) if rng.random() < 0.25 else _between(rng, 0.46, 0.5)
    return ellipsoid(CENTRE, (0.5, across, across), 25, 32)


def _box(rng: np.random.Generator) -> Mesh:
    """A parcel, some with open flaps."""
    x, y, z = 1.0, _log(rng, 0.35, 1.0), _log(rng, 0.3, 1.0)
    parts = [box(CENTRE, (x, y, z))]
    if rng.random() < 0.4:
        for side in (-1.0, 1.0):
            deep = _between(rng, 0.25, 0.5) * y
            flap = moved(box((0.0, side * deep / 2, 0.0), (x, deep, 2 * THIN)), CENTRE)
            lifted = moved(flap, CENTRE, rotation_about((1.0, 0.0, 0.0), side * _between(rng, 20.0, 110.0)))
            parts.append(moved(lifted, (0.0, side * y / 2, z / 2)))
    return merge(*parts)


def _one_balloon(radius: float, tall: float) -> Mesh:
    """Round above and narrow below, its knot at the origin's underside."""
    keys = [(0.0, 0.04 * radius, 0.04 * radius, 0.0), (0.25 * tall, 0.45 * radius, 0.45 * radius, 0.0)]
    keys += [(0.65 * tall, radius, radius, 0.0), (tall, 0.05 * radius, 0.05 * radius, 0.0)]
    return moved(body(keys), CENTRE, rotation_about((0.0, 1.0, 0.0), -90.0))


def _load(rng: np.random.Generator, at: Vector) -> Mesh:
    size = _between(rng, 0.08, 0.25)
    return box(at, (size, size * _between(rng, 0.6, 1.0), size * _between(rng, 0.5, 1.2)))


def _balloon(rng: np.random.Generator) -> Mesh:
    """One balloon with a string, some with a load."""
    tall, down = _between(rng, 0.8, 1.1), _between(rng, 0.2, 1.0)
    parts = [_one_balloon(tall * _between(rng, 0.36, 0.48), tall)]
    line = wavy_line(CENTRE, (0.0, 0.0, -down), 0.1 * down, rng)
    parts.append(cord(line, THIN))
    if rng.random() < 0.5:
        parts.append(_load(rng, line[-1]))
    return merge(*parts)


def _balloons(rng: np.random.Generator) -> Mesh:
    """A bunch, whose strings meet below."""
    knot, parts = (0.0, 0.0, -_between(rng, 0.8, 1.6)), []
    for _ in range(int(rng.integers(3, 9))):
        away = rng.normal(0.0, 1.0, 3) * np.array([0.35, 0.35, 0.25])
        at = (float(away[0]), float(away[1]), float(away[2]))
        tall = _between(rng, 0.35, 0.55)
        parts += [moved(_one_balloon(0.42 * tall, tall), at), cord([at, knot], THIN)]
    if rng.random() < 0.5:
        parts.append(_load(rng, knot))
    return merge(*parts)


def _kite(rng: np.random.Generator) -> Mesh:
    """A diamond, a delta or a box kite with its tail; the nose is +X."""
    kind, tail = rng.random(), _between(rng, 0.6, 2.0)
    if kind < 0.5:
        x, widest = np.array([-0.6, 0.1, 0.4]), _between(rng, 0.3, 0.45)
        sail = sheet(x, np.array([0.01, widest, 0.01]), fold=_between(rng, -0.05, 0.25), bend=0.0, twist=0.0)
    elif kind < 0.8:
        x, widest = np.array([-0.35, -0.25, 0.4]), _between(rng, 0.5, 0.9)
        sail = sheet(x, np.array([0.55 * widest, widest, 0.01]), fold=_between(rng, 0.0, 0.2), bend=0.0, twist=0.0)
    else:
        wide, high = _between(rng, 0.25, 0.4), _between(rng, 0.25, 0.4)
        cells = [_cell(at, wide, high) for at in (-0.35, 0.35)]
        spars = [tube((-0.5, a * wide / 2, b * high / 2), (0.5, a * wide / 2, b * high / 2), 2 * THIN)
                 for a in (-1, 1) for b in (-1, 1)]  # fmt: skip
        return merge(*cells, *spars)
    end = float(x[0])
    line = wavy_line((end, 0.0, 0.0), (end - tail, 0.0, -_between(rng, 0.0, 0.8) * tail), 0.12 * tail, rng)
    bows = [box(at, (0.04, 0.16, 0.02)) for at in line[2::2]]
    return merge(sail, tube((end, 0.0, THIN), (0.4, 0.0, THIN), 2 * THIN), cord(line, 1.5 * THIN), *bows)


def _cell(at: float, wide: float, high: float) -> Mesh:
    """Four sails around the spars of a box kite."""
    flat = [box((at, 0.0, side * high / 2), (0.28, wide, 2 * THIN)) for side in (-1, 1)]
    upright = [box((at, side * wide / 2, 0.0), (0.28, 2 * THIN, high)) for side in (-1, 1)]
    return merge(*flat, *upright)


def _leaf(rng: np.random.Generator) -> Mesh:
    """A leaf with its stalk, narrow or broad, smooth or toothed."""
    x, power = np.linspace(-0.45, 0.5, 15), _between(rng, 0.6, 1.4)
    share = (x - x[0]) / (x[-1] - x[0])
    widest = _log(rng, 0.1, 0.4)
    width = widest * np.sin(np.pi * share ** _between(rng, 0.6, 1.3)).clip(0.02) ** power
    if rng.random() < 0.4:
        width = width * (1 + _between(rng, 0.1, 0.45) * np.cos(np.pi * np.arange(len(x))))
    bend, twist = float(rng.normal(0.0, 0.5)), float(rng.normal(0.0, 0.8))
    blade = sheet(x, width, fold=_between(rng, -0.2, 0.6), bend=bend, twist=twist)
    stalk = [(at, 0.0, bend * at * at) for at in (-0.45 - _between(rng, 0.1, 0.3), -0.4)]
    return merge(blade, cord(stalk, 2 * THIN))


def _disc(rng: np.random.Generator) -> Mesh:
    """A throwing disc."""
    high, top = _between(rng, 0.05, 0.12), _between(rng, 0.6, 0.9)
    return tube((0.0, 0.0, -high), (0.0, 0.0, high), 0.5, 0.5 * top, sides=32)


def _bottle(rng: np.random.Generator) -> Mesh:
    """A bottle, its neck at +X."""
    wide, neck, shoulder = _between(rng, 0.12, 0.2), _between(rng, 0.04, 0.07), _between(rng, 0.1, 0.3)
    keys = [(-0.5, wide, wide, 0.0), (shoulder - 0.2, wide, wide, 0.0), (shoulder, wide, wide, 0.0)]
    return body([*keys, (0.4, neck, neck, 0.0), (0.5, neck, neck, 0.0)], power=1.0)


def _bag(rng: np.random.Generator) -> Mesh:
    """A plastic bag in the wind, some with handles."""
    radii = (0.5, _between(rng, 0.25, 0.5), _between(rng, 0.2, 0.45))
    parts = [lump(radii, 6, _between(rng, 0.08, 0.25), rng)]
    if rng.random() < 0.5:
        parts += [hoop((0.5, side * 0.12, 0.0), (0.0, 1.0, 0.0), _between(rng, 0.1, 0.18), 0.03) for side in (-1, 1)]
    return merge(*parts)


def _lantern(rng: np.random.Generator) -> Mesh:
    """A sky lantern: paper wider above, a dome, and a ring below."""
    tall, low = _between(rng, 0.7, 1.1), _between(rng, 0.2, 0.35)
    high = low * _between(rng, 1.1, 1.5)
    top = ellipsoid((0.0, 0.0, tall), (high, high, high * _between(rng, 0.3, 0.7)), 13, 24)
    return merge(tube(CENTRE, (0.0, 0.0, tall), low, high, sides=24), top, hoop(CENTRE, (0.0, 0.0, 1.0), low, 0.03))


def _umbrella(rng: np.random.Generator) -> Mesh:
    """An open umbrella that the wind has taken."""
    deep, wide = _between(rng, 0.15, 0.35), 0.5
    canopy = tube((0.0, 0.0, 0.0), (0.0, 0.0, deep), wide, 0.03, sides=8)
    shaft = tube((0.0, 0.0, deep), (0.0, 0.0, -_between(rng, 0.4, 0.6)), 2 * THIN)
    return merge(canopy, shaft)


def _tyre(rng: np.random.Generator) -> Mesh:
    """A ring: a tyre or a hoop."""
    return hoop(CENTRE, (0.0, 1.0, 0.0), 0.4, _log(rng, 0.03, 0.25), sides=32)


def _branch(rng: np.random.Generator) -> Mesh:
    """A twig with side twigs and leaves."""
    stem = wavy_line((-0.5, 0.0, 0.0), (0.5, 0.0, 0.0), 0.12, rng)
    parts = [cord(stem, _between(rng, 0.01, 0.025))]
    for at in stem[1:-1: int(rng.integers(1, 3))]:  # fmt: skip
        reach = rng.normal(0.0, 0.18, 3)
        tip = (at[0] + 0.1 + float(reach[0]), at[1] + float(reach[1]), at[2] + float(reach[2]))
        parts += [cord([at, tip], 0.01), ellipsoid(tip, (_between(rng, 0.03, 0.1), 0.05, 0.02), 7, 10)]
    return merge(*parts)


def _debris(rng: np.random.Generator) -> Mesh:
    """Blocks and lumps that hang together."""
    parts = []
    for _ in range(int(rng.integers(1, 5))):
        radii = (_log(rng, 0.12, 0.5), _log(rng, 0.08, 0.4), _log(rng, 0.05, 0.4))
        one = lump(radii, 5, 0.12, rng) if rng.random() < 0.5 else box(CENTRE, (2 * radii[0], 2 * radii[1], radii[2]))
        turn = rotation_about((float(rng.normal()), float(rng.normal()), 1.0), _between(rng, 0.0, 360.0))
        x, y, z = rng.normal(0.0, 0.12, 3).tolist()
        parts.append(moved(one, (x, y, z), turn))
    return merge(*parts)


KINDS: dict[str, OutlierKind] = {
    "disc": OutlierKind(_disc, "spinning", "val"),
    "bottle": OutlierKind(_bottle, "thrown", "val"),
    "bag": OutlierKind(_bag, "drifting", "val"),
    "lantern": OutlierKind(_lantern, "drifting", "val"),
    "umbrella": OutlierKind(_umbrella, "drifting", "val"),
    "tyre": OutlierKind(_tyre, "thrown", "val"),
    "branch": OutlierKind(_branch, "fluttering", "val"),
    "debris": OutlierKind(_debris, "thrown", "val"),
    "ball": OutlierKind(_ball, "thrown", "test"),
    "box": OutlierKind(_box, "thrown", "test"),
    "balloon": OutlierKind(_balloon, "drifting", "test"),
    "balloons": OutlierKind(_balloons, "drifting", "test"),
    "kite": OutlierKind(_kite, "tethered", "test"),
    "leaf": OutlierKind(_leaf, "fluttering", "test"),
}
"""By name; bottles, tyres and debris tumble, so do balls and boxes."""
