"""A seeded landscape for Sim-2 and Sim-3: rolling fields to the horizon, hedges, trees, woods and buildings.

The land is level around the origin, so that cameras stand where a rig puts them, and everything that rises keeps clear
of the given points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from kernels.rays.landscape import FIELDS, FOLIAGE, PLAIN, LandscapeMesh

PALETTE = np.array(
    [
        (0.10, 0.15, 0.035),
        (0.16, 0.18, 0.05),
        (0.07, 0.12, 0.03),
        (0.30, 0.25, 0.10),
        (0.13, 0.10, 0.06),
        (0.20, 0.21, 0.07),
    ]
)
"""Linear reflectance of fields: meadow, pasture, crop, stubble, soil, dry grass."""


@dataclass(frozen=True)
class LandscapeConfig:
    """What stands in the landscape.

    radius: metres from the origin to the edge of the land.
    relief: metres of the hills far away.
    level_radius: metres around the origin where the land is level.
    trees, woods, hedges, buildings: how many (a wood has about thirty trees).
    clear_radius: metres around each point to keep clear.
    """

    radius: float = 5000.0
    relief: float = 60.0
    level_radius: float = 120.0
    trees: int = 70
    woods: int = 14
    hedges: int = 24
    buildings: int = 22
    clear_radius: float = 18.0


@dataclass(frozen=True)
class _Shape:
    """A mesh in its own frame, z up, with one albedo and kind a face."""

    vertices: Float[np.ndarray, "vertex 3"]
    faces: Int[np.ndarray, "face 3"]
    albedo: Float[np.ndarray, "face 3"]
    kind: Int[np.ndarray, "face"]


class Terrain:
    """Heights of the land: level near the origin, a sum of seeded waves further away."""

    def __init__(self, config: LandscapeConfig, rng: np.random.Generator):
        self._config = config
        angle, length = rng.uniform(0, 2 * np.pi, 7), np.geomspace(180.0, 1500.0, 7)
        self._wave = np.stack([np.cos(angle), np.sin(angle)]) * 2 * np.pi / length
        self._phase, self._height = rng.uniform(0, 2 * np.pi, 7), length / length.sum()

    def height(self, points: Float[np.ndarray, "point 2"]) -> Float[np.ndarray, "point"]:
        """Metres above the level at the origin."""
        waves = (np.sin(points @ self._wave + self._phase) * self._height).sum(axis=1)
        far = np.hypot(points[:, 0], points[:, 1]) - self._config.level_radius
        rise = np.clip(far / 900.0, 0.0, 1.0) ** 2
        return rise * self._config.relief * (waves + 0.35)


def build_landscape(config: LandscapeConfig, keep_clear: Float[np.ndarray, "point 2"], *, seed: int) -> LandscapeMesh:
    """Build a landscape.

    Args:
        config: what stands in it.
        keep_clear: x and y of places that nothing may stand near (cameras, where objects fly low), metres.
        seed: decides everything.
    """
    rng = np.random.default_rng(seed)
    terrain = Terrain(config, rng)
    places = [np.zeros((1, 2)), keep_clear]
    clear = np.concatenate(places)
    shapes = [_land(config, terrain)]
    shapes += [_placed(_tree(rng), spot, terrain) for spot in _spots(config.trees, 25.0, 350.0, clear, config, rng)]
    for spot in _spots(config.woods, 220.0, 1500.0, clear, config, rng):
        around = spot + rng.normal(0.0, 28.0, (30, 2))
        shapes += [_placed(_tree(rng, coarse=True), p, terrain) for p in around if _is_clear(p, clear, config)]
    for spot in _spots(config.hedges, 60.0, 900.0, clear, config, rng):
        shapes += _hedge(spot, clear, config, terrain, rng)
    for spot in _spots(config.buildings, 45.0, 700.0, clear, config, rng):
        shapes.append(_placed(_building(rng), spot, terrain))
    return _joined(shapes, seed)


def _joined(shapes: list[_Shape], seed: int) -> LandscapeMesh:
    counts = np.cumsum([0] + [len(s.vertices) for s in shapes])
    return LandscapeMesh(
        vertices=np.concatenate([s.vertices for s in shapes]).astype(np.float32),
        faces=np.concatenate([s.faces + at for s, at in zip(shapes, counts, strict=False)]).astype(np.int32),
        albedo=np.concatenate([s.albedo for s in shapes]).astype(np.float32),
        kind=np.concatenate([s.kind for s in shapes]).astype(np.int32),
        palette=PALETTE.astype(np.float32),
        seed=seed % 2**31,
    )


def _is_clear(spot: np.ndarray, clear: np.ndarray, config: LandscapeConfig) -> bool:
    return bool(np.hypot(*(clear - spot).T).min() > config.clear_radius)


def _spots(
    count: int, nearest: float, furthest: float, clear: np.ndarray, config: LandscapeConfig, rng: np.random.Generator
) -> list[np.ndarray]:
    """Seeded places, denser near the origin, away from what is to stay clear."""
    found: list[np.ndarray] = []
    for _ in range(20 * count):
        if len(found) == count:
            break
        distance = nearest * (furthest / nearest) ** rng.uniform()
        turn = rng.uniform(0, 2 * np.pi)
        spot = distance * np.array([np.cos(turn), np.sin(turn)])
        if _is_clear(spot, clear, config):
            found.append(spot)
    return found


def _placed(shape: _Shape, spot: np.ndarray, terrain: Terrain) -> _Shape:
    base = np.array([spot[0], spot[1], float(terrain.height(spot[None])[0]) - 0.2])
    return _Shape(shape.vertices + base, shape.faces, shape.albedo, shape.kind)


def _up(height: float) -> np.ndarray:
    return np.array([0.0, 0.0, height])


def _uniform(
    vertices: np.ndarray, faces: np.ndarray, albedo: tuple[float, float, float] | np.ndarray, kind: int
) -> _Shape:
    colours = np.broadcast_to(np.asarray(albedo, np.float64), (len(faces), 3)).copy()
    return _Shape(np.asarray(vertices, np.float64), np.asarray(faces), colours, np.full(len(faces), kind))


def _merged(*shapes: _Shape) -> _Shape:
    counts = np.cumsum([0] + [len(s.vertices) for s in shapes])
    faces = np.concatenate([s.faces + at for s, at in zip(shapes, counts, strict=False)])
    kinds = np.concatenate([s.kind for s in shapes])
    return _Shape(
        np.concatenate([s.vertices for s in shapes]), faces, np.concatenate([s.albedo for s in shapes]), kinds
    )


def _land(config: LandscapeConfig, terrain: Terrain) -> _Shape:
    """Rings of triangles whose size grows with the distance."""
    turns, radii = 160, np.concatenate([[3.0], np.geomspace(8.0, config.radius, 90)])
    angle = 2 * np.pi * np.arange(turns) / turns
    flat = (radii[:, None, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)).reshape(-1, 2)
    flat = np.concatenate([flat, np.zeros((1, 2))])
    vertices = np.concatenate([flat, terrain.height(flat)[:, None]], axis=1)
    ring, step = np.meshgrid(np.arange(len(radii) - 1), np.arange(turns), indexing="ij")
    after = (step + 1) % turns
    a, b, c, d = ring * turns + step, (ring + 1) * turns + step, (ring + 1) * turns + after, ring * turns + after
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    cap = np.stack([np.full(turns, len(vertices) - 1), np.arange(turns), (np.arange(turns) + 1) % turns], axis=1)
    return _uniform(vertices, np.concatenate([faces, cap]), PALETTE[0], FIELDS)


def _ball(turns: int, rings: int) -> tuple[np.ndarray, np.ndarray]:
    """A unit sphere of rings with poles."""
    polar, around = np.pi * np.arange(1, rings) / rings, 2 * np.pi * np.arange(turns) / turns
    middle = np.stack(
        [
            np.outer(np.sin(polar), np.cos(around)),
            np.outer(np.sin(polar), np.sin(around)),
            np.repeat(np.cos(polar)[:, None], turns, 1),
        ],
        -1,
    ).reshape(-1, 3)
    vertices = np.concatenate([[[0, 0, 1.0]], middle, [[0, 0, -1.0]]])
    j = np.arange(turns)
    n = (j + 1) % turns
    faces = [np.stack([np.zeros(turns, int), 1 + j, 1 + n], 1)]
    for r in range(rings - 2):
        low, high = 1 + (r + 1) * turns, 1 + r * turns
        faces += [np.stack([high + j, low + j, low + n], 1), np.stack([high + j, low + n, high + n], 1)]
    last = 1 + (rings - 2) * turns
    faces.append(np.stack([last + j, np.full(turns, len(vertices) - 1), last + n], 1))
    return vertices, np.concatenate(faces)


def _tube(turns: int, low: float, high: float, height: float) -> tuple[np.ndarray, np.ndarray]:
    """An open frustum about z from the ground up; `high` may be 0 for a cone."""
    angle = 2 * np.pi * np.arange(turns) / turns
    ring = np.stack([np.cos(angle), np.sin(angle), np.zeros(turns)], axis=1)
    vertices = np.concatenate([ring * low, ring * max(high, 1e-3) + [0, 0, height]])
    j = np.arange(turns)
    n = (j + 1) % turns
    return vertices, np.concatenate([np.stack([j, n, turns + n], 1), np.stack([j, turns + n, turns + j], 1)])


def _tree(rng: np.random.Generator, *, coarse: bool = False) -> _Shape:
    """A conifer of stacked cones or a broad-leaved tree of lumpy balls; trunk below."""
    height = rng.uniform(7.0, 17.0)
    green = np.array([0.035, 0.07, 0.018]) * rng.uniform([0.7, 0.7, 0.6], [1.9, 1.5, 1.5])
    trunk = _uniform(*_tube(6, 0.03 * height, 0.02 * height, 0.5 * height), (0.09, 0.06, 0.04), PLAIN)
    if rng.uniform() < 0.35:
        tiers = 3 if coarse else 7
        parts = []
        for k in range(tiers):
            vertices, faces = _tube(9 if coarse else 16, 0.2 * height * (1.05 - k / tiers), 0.0, 0.42 * height)
            vertices[: len(vertices) // 2] *= rng.uniform(0.75, 1.2, (len(vertices) // 2, 1))
            parts.append(_uniform(vertices + _up(height * (0.15 + 0.62 * k / tiers)), faces, 0.7 * green, FOLIAGE))
        return _merged(trunk, *parts)
    parts = []
    for _ in range(2 if coarse else 9):
        vertices, faces = _ball(8, 5) if coarse else _ball(12, 8)
        size = height * rng.uniform(0.24, 0.34) * (1.25 if coarse else 0.8)
        vertices = vertices * rng.uniform(0.8, 1.2, (len(vertices), 1)) * size * [1, 1, 0.85]
        spread = rng.normal(0.0, 0.12, 3) * height
        parts.append(_uniform(vertices + spread + _up(0.66 * height), faces, green * rng.uniform(0.85, 1.15), FOLIAGE))
    return _merged(trunk, *parts)


def _hedge(
    spot: np.ndarray, clear: np.ndarray, config: LandscapeConfig, terrain: Terrain, rng: np.random.Generator
) -> list[_Shape]:
    """Bushes in a row."""
    turn, length = rng.uniform(0, np.pi), rng.uniform(30.0, 120.0)
    along = np.array([np.cos(turn), np.sin(turn)])
    green = np.array([0.04, 0.08, 0.02]) * rng.uniform(0.7, 1.5)
    found = []
    for step in np.arange(-length / 2, length / 2, 2.2):
        place = spot + step * along
        if _is_clear(place, clear, config):
            vertices, faces = _ball(8, 5)
            shape = vertices * rng.uniform(0.8, 1.2, (len(vertices), 1)) * [1.7, 1.7, rng.uniform(1.1, 1.7)]
            found.append(_placed(_uniform(shape + _up(0.8), faces, green, FOLIAGE), place, terrain))
    return found


def _building(rng: np.random.Generator) -> _Shape:
    """A house or barn with a gabled roof, windows and a door."""
    long, wide, high = rng.uniform(8.0, 26.0), rng.uniform(6.0, 12.0), rng.uniform(3.0, 8.0)
    wall = np.array([0.55, 0.5, 0.43]) * rng.uniform(0.6, 1.3) * rng.uniform(0.9, 1.1, 3)
    tile = np.array([(0.28, 0.10, 0.06), (0.12, 0.12, 0.13), (0.2, 0.15, 0.12)][rng.integers(3)])
    x, y, top = long / 2, wide / 2, high + 0.35 * wide
    corner = [(-x, -y), (x, -y), (x, y), (-x, y)]
    body = np.array([(*c, -1.0) for c in corner] + [(*c, high) for c in corner] + [(-x, 0, top), (x, 0, top)])
    sides = [
        (0, 1, 5),
        (0, 5, 4),
        (1, 2, 6),
        (1, 6, 5),
        (2, 3, 7),
        (2, 7, 6),
        (3, 0, 4),
        (3, 4, 7),
        (5, 6, 9),
        (7, 4, 8),
    ]
    over = np.array([1.04, 1.12, 1.0])
    roof = np.array([(-x, -y, high), (x, -y, high), (x, y, high), (-x, y, high), (-x, 0, top), (x, 0, top)]) * over
    slopes = [(0, 1, 5), (0, 5, 4), (2, 3, 4), (2, 4, 5)]
    parts = [_uniform(body, np.array(sides), wall, PLAIN), _uniform(roof + _up(0.08), np.array(slopes), tile, PLAIN)]
    for level in np.arange(1.2, high - 1.0, 2.8):
        for at in np.arange(-x + 1.5, x - 1.5, 2.6):
            for side in (-1.0, 1.0):
                parts.append(_pane(at, side * (y + 0.02), level, side))
    turn = rng.uniform(0, 2 * np.pi)
    rotation = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1.0]])
    whole = _merged(*parts)
    return _Shape(whole.vertices @ rotation.T, whole.faces, whole.albedo, whole.kind)


def _pane(at: float, y: float, level: float, side: float) -> _Shape:
    vertices = np.array([(at, y, level), (at + 1.1, y, level), (at + 1.1, y, level + 1.3), (at, y, level + 1.3)])
    faces = np.array([(0, 1, 2), (0, 2, 3)] if side < 0 else [(0, 2, 1), (0, 3, 2)])
    return _uniform(vertices, faces, (0.03, 0.035, 0.045), PLAIN)
