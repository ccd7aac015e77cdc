"""Measurements on rotorcraft assets: surface samples, number of loose pieces, what a rotor's blades strike."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from scipy import ndimage, sparse

from aerojax.simulate.assets.mesh.parts import Part
from aerojax.simulate.assets.mesh.shapes import Mesh, frame_along
from aerojax.simulate.usd.authoring import Asset


def placed(part: Part) -> Mesh:
    """A part in the body frame; a spinning one at phase zero."""
    if part.spin is None:
        return part.mesh
    turn = frame_along(np.asarray(part.spin.axis, float))
    return Mesh(part.mesh.points @ turn.T + np.asarray(part.spin.hub), part.mesh.faces)


def samples(mesh: Mesh, spacing: float) -> Float[np.ndarray, "point 3"]:
    """Random points on the surface, twelve to a square of side `spacing` (metres)."""
    corner = mesh.points[mesh.faces]
    area = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1) / 2
    rng = np.random.default_rng(0)
    face = rng.choice(len(area), int(12 * area.sum() / spacing**2) + 8, p=area / area.sum())
    u, v = np.sqrt(rng.random(len(face)))[:, None], rng.random(len(face))[:, None]
    return (1 - u) * corner[face, 0] + u * (1 - v) * corner[face, 1] + u * v * corner[face, 2]


def loose_pieces(asset: Asset, cell: float = 0.015) -> int:
    """How many pieces remain when everything within a cell's width of each other is glued together."""
    points = np.concatenate([samples(placed(part), cell) for part in asset.parts])
    index = np.floor((points - points.min(0)) / cell).astype(int)
    grid = np.zeros(index.max(0) + 1, bool)
    grid[tuple(index.T)] = True
    return ndimage.label(grid, np.ones((3, 3, 3)))[1]


def struck_share(asset: Asset, half_height: float = 0.003) -> float:
    """Largest share of a rotor's radius that its blades strike in the fixed parts; 0 if every disc is clear.

    The disc is flat and thinner than the blades; the inner eighth, which holds hub and mast, does not count.
    """
    fixed = np.concatenate([samples(part.mesh, 0.02) for part in asset.parts if part.spin is None])
    worst = 0.0
    for part in asset.parts:
        if part.spin is None:
            continue
        radius = float(np.linalg.norm(part.mesh.points[:, :2], axis=1).max())
        local = (fixed - np.asarray(part.spin.hub)) @ frame_along(np.asarray(part.spin.axis, float))
        reach = np.linalg.norm(local[:, :2], axis=1) / radius
        inside = (np.abs(local[:, 2]) < half_height) & (reach > 0.125) & (reach < 1.0)
        worst = max(worst, float(np.ptp(np.concatenate([reach[inside], [1.0]]))) if inside.any() else 0.0)
    return worst


def is_closed(mesh: Mesh) -> bool:
    """Whether every edge joins two faces that agree on its side, and every connected piece is wound outwards."""
    count = len(mesh.points)
    edges = np.concatenate([mesh.faces[:, [i, (i + 1) % 3]] for i in range(3)]).astype(np.int64)
    there, back = edges @ [count, 1], edges @ [1, count]
    if len(np.unique(there)) != len(there) or not np.array_equal(np.sort(there), np.sort(back)):
        return False
    graph = sparse.coo_matrix((np.ones(len(edges)), tuple(edges.T)), shape=(count, count))
    piece = sparse.csgraph.connected_components(graph, directed=False)[1][mesh.faces[:, 0]]
    a, b, c = (mesh.points[mesh.faces[:, i]] for i in range(3))
    volume = np.bincount(piece, np.einsum("ij,ij->i", a - mesh.points[0], np.cross(b - a, c - a)))
    return bool((volume[np.unique(piece)] > 0).all())


def triangles(asset: Asset) -> int:
    """Triangles of all parts."""
    return sum(len(part.mesh.faces) for part in asset.parts)
