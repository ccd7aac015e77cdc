"""Variations of built assets: stretched bodies, missing parts, angular meshes, loads, rotors at any speed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from aerojax.simulate.assets.mesh.parts import Part, face_normals
from aerojax.simulate.assets.mesh.shapes import Mesh, box, ellipsoid, merge, scaled, tube
from aerojax.simulate.usd.authoring import Asset


@dataclass(frozen=True)
class VariationConfig:
    """How often and how far individuals are varied.

    stretched, stretch: probability, and range of the factor along each axis (log-uniform).
    angular, cell: probability that a body is angular, and edge of the cells within which its points are joined, over
        the asset's largest extent.
    without, thinned: probability that a removable part is absent, and that some of its solids are.
    loaded: probability of a load under the body that the families do not have.
    stopped, slow, slowed, speed: probabilities that rotors stand or are slow, the factor on the rate of slow ones
        (log-uniform) and of all others.
    """

    stretched: float = 0.6
    stretch: tuple[float, float] = (0.75, 1.33)
    angular: float = 0.18
    cell: tuple[float, float] = (0.02, 0.06)
    without: float = 0.12
    thinned: float = 0.08
    loaded: float = 0.1
    stopped: float = 0.12
    slow: float = 0.2
    slowed: tuple[float, float] = (0.05, 0.5)
    speed: tuple[float, float] = (0.7, 1.3)


REMOVABLE = {
    "drone": ("guards", "legs", "battery", "gimbal", "masts", "payload", "roof", "boom"),
    "airplane": ("gear", "struts", "canopy", "engines"),
    "helicopter": ("gear", "cowling", "glass", "stub_wings", "sponsons", "cargo"),
}
"""Parts without which an asset of the class stays what it is."""
THINNABLE = {
    "drone": ("guards", "legs", "masts"),
    "airplane": ("gear", "struts", "tail"),
    "helicopter": ("gear", "stub_wings"),
}
"""Parts that may lose some of their solids."""


def draw_factors(config: VariationConfig, rng: np.random.Generator) -> Float[np.ndarray, "3"]:
    """Factors along x, y and z; ones for most of those that are not stretched."""
    if rng.random() >= config.stretched:
        return np.ones(3)
    return np.exp(rng.uniform(*np.log(config.stretch), size=3))


def varied(asset: Asset, label: str, config: VariationConfig, rng: np.random.Generator) -> Asset:
    """A variation of an asset whose moving parts are rotors; its size is no longer normalised.

    Args:
        asset: in the body frame.
        label: "drone", "airplane" or "helicopter".
        config: probabilities and ranges.
        rng: draws everything.
    """
    parts = _reduced(asset.parts, label, config, rng)
    if rng.random() < config.loaded:
        parts = (*parts, Part("load", _load(parts, label, rng), 6))
    factors = draw_factors(config, rng)
    parts = tuple(_stretched(part, factors) for part in parts)
    if rng.random() < config.angular:
        extent = max(np.ptp(part.mesh.points, axis=0).max() for part in parts)
        cell = float(rng.uniform(*config.cell) * extent)
        parts = tuple(replace(p, mesh=angular(p.mesh, cell)[0]) if p.spin is None else p for p in parts)
    pace = _pace(config, rng)
    return replace(asset, parts=tuple(_paced(part, pace) for part in parts))


def _pace(config: VariationConfig, rng: np.random.Generator) -> float:
    """The factor on the rate of all rotors."""
    kind = rng.random()
    if kind < config.stopped:
        return 0.0
    if kind < config.stopped + config.slow:
        return float(np.exp(rng.uniform(*np.log(config.slowed))))
    return float(rng.uniform(*config.speed))


def _paced(part: Part, pace: float) -> Part:
    return part if part.spin is None else replace(part, spin=replace(part.spin, hertz=pace * part.spin.hertz))


def _stretched(part: Part, factors: Float[np.ndarray, "3"]) -> Part:
    """Fixed parts stretch; a rotor keeps its shape and takes the smallest factor across its axis, so that discs which
    were clear of each other stay clear."""
    if part.spin is None:
        return replace(part, mesh=Mesh(part.mesh.points * factors, part.mesh.faces))
    axis = int(np.abs(part.spin.axis).argmax())
    x, y, z = (float(v) for v in np.asarray(part.spin.hub) * factors)
    size = float(np.delete(factors, axis).min())
    return replace(part, mesh=scaled(part.mesh, size), spin=replace(part.spin, hub=(x, y, z)))


def _reduced(parts: Sequence[Part], label: str, config: VariationConfig, rng: np.random.Generator) -> tuple[Part, ...]:
    kept = []
    for part in parts:
        if part.name in REMOVABLE[label] and rng.random() < config.without:
            continue
        if part.name in THINNABLE[label] and rng.random() < config.thinned:
            mesh = thinned(part.mesh, rng)
            if part.name != "tail" or _attached(mesh, parts[0].mesh):
                part = replace(part, mesh=mesh)
        kept.append(part)
    return tuple(kept)


def solids(mesh: Mesh) -> Int[np.ndarray, "vertex"]:
    """Number of the closed solid that each vertex belongs to."""
    a, b, c = mesh.faces.T
    rows, columns = np.concatenate([a, b]), np.concatenate([b, c])
    joined = coo_array((np.ones(len(rows)), (rows, columns)), shape=(len(mesh.points),) * 2)
    return connected_components(joined, directed=False)[1].astype(np.int64)


def thinned(mesh: Mesh, rng: np.random.Generator) -> Mesh:
    """The mesh without the solids on one side: up to half of them, those nearest to one of them in plan view.

    A leg goes with its wheel; one solid stays in any case.
    """
    number = solids(mesh)
    count = int(number.max()) + 1
    if count < 2:
        return mesh
    middle = np.stack([np.bincount(number, mesh.points[:, i]) for i in (0, 1)], axis=1) / np.bincount(number)[:, None]
    away = np.linalg.norm(middle - middle[int(rng.integers(count))], axis=1)
    kept = np.argsort(away, kind="stable")[max(1, int(count * rng.uniform(0.2, 0.5))) :]
    inside = np.isin(number, kept)
    place = np.cumsum(inside) - 1
    return Mesh(mesh.points[inside], place[mesh.faces[inside[mesh.faces[:, 0]]]])


def _attached(mesh: Mesh, body: Mesh) -> bool:
    """Whether the bounding box of every solid meets the body's: a tailplane may not float where a fin carried it."""
    low, high = body.points.min(axis=0), body.points.max(axis=0)
    number = solids(mesh)
    pieces = [mesh.points[number == i] for i in range(int(number.max()) + 1)]
    return all(bool((p.min(axis=0) <= high).all() and (p.max(axis=0) >= low).all()) for p in pieces)


def angular(mesh: Mesh, cell: float) -> tuple[Mesh, Int[np.ndarray, "vertex"]]:
    """Few large facets: points of a solid in one cell that face the same octant become their mean.

    Vertex clustering (Rossignac & Borrel 1993); telling octants apart keeps thin wings and tubes from collapsing.

    Args:
        mesh: closed solids.
        cell: edge of the cells, metres.

    Returns:
        The mesh, and for every old vertex the new one that it became.
    """
    normals = np.zeros_like(mesh.points)
    np.add.at(normals, mesh.faces.reshape(-1), np.repeat(face_normals(mesh), 3, axis=0))
    key = np.floor(mesh.points / cell).astype(np.int64)
    octant = (normals > 0) @ np.array([1, 2, 4])
    code = np.concatenate([solids(mesh)[:, None], octant[:, None], key], axis=1)
    _, which = np.unique(code, axis=0, return_inverse=True)
    which = which.reshape(-1)
    count = np.bincount(which)
    points = np.stack([np.bincount(which, mesh.points[:, i]) / count for i in range(3)], axis=1)
    faces = which[mesh.faces]
    a, b, c = faces.T
    return Mesh(points, faces[(a != b) & (b != c) & (c != a)]), which


def _load(parts: Sequence[Part], label: str, rng: np.random.Generator) -> Mesh:
    """A load that no family has: a pod or a box under the body, close below it or on a line; tanks under wings."""
    fixed = np.concatenate([part.mesh.points for part in parts if part.spin is None])
    body = parts[0].mesh.points
    low, size = float(body[:, 2].min()), float(rng.uniform(0.06, 0.16) * np.ptp(fixed, axis=0).max())
    x = float((body[:, 0].min() + body[:, 0].max()) / 2)
    if label == "airplane":
        y, radius = float(rng.uniform(0.12, 0.3)), 0.22 * size
        wing = next((part.mesh.points for part in parts if part.name == "wings"), body)
        near = wing[np.abs(np.abs(wing[:, 1]) - y).argsort()[:16]]
        x, z = float(near[:, 0].mean()), float(near[:, 2].min()) - 0.8 * radius
        return merge(*(ellipsoid((x, side * y, z), (size, radius, radius), 7, 10) for side in (-1.0, 1.0)))
    drop = float(rng.choice([0.0, 1.0]) * rng.uniform(0.1, 0.5))
    centre = (x, 0.0, low - drop - 0.4 * size)
    body_of_load = (
        box(centre, (size, 0.8 * size, 0.7 * size))
        if rng.random() < 0.5
        else ellipsoid(centre, (0.7 * size, 0.45 * size, 0.4 * size), 7, 10)
    )
    return body_of_load if drop == 0 else merge(body_of_load, tube((x, 0.0, low + 0.02), centre, 0.006, sides=6))
