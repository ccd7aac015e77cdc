"""Any number of painted solids: random pieces stuck onto each other, bent and mirrored, each solid from its seed."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from aerojax.core.seeds import seed_of
from aerojax.simulate.assets.animated import animated_asset
from aerojax.simulate.assets.mesh.parts import Part
from aerojax.simulate.assets.mesh.shapes import Mesh, mirrored
from aerojax.simulate.assets.paint.patterns import ROLES
from aerojax.simulate.assets.solids.pieces import draw_piece
from aerojax.simulate.usd.animated_mesh import AnimatedMesh
from aerojax.simulate.usd.authoring import Asset

COUNTS = (0.25, 0.2, 0.2, 0.15, 0.1, 0.1)
"""How often a solid has 1, 2, … pieces."""
SIZES = (0.15, 0.9)
"""Length of a further piece over the first one's; logarithmic."""
MIRRORED, BENT = 0.4, 0.35
"""Share of the solids with a plane of symmetry, and of those that are bent, tapered or twisted."""
EDGE = 0.035
"""Longest edge of a face, over the solid's size: a face has one colour, so patterns need small ones."""
MOST_FACES = 16_000
"""Faces of a part beyond which edges stay as long as they are."""


def solid_name(number: int, seed: int = 0) -> str:
    """The name of solid `number` of a series."""
    return f"solid_{seed}_{number:06d}"


def build_solid(name: str) -> AnimatedMesh:
    """A solid of about one metre that does not move, turned at random; every face has one colour.

    Args:
        name: from `solid_name`; shape and colours follow from it.
    """
    rng = np.random.default_rng(seed_of("aerojax", "solid", name))
    pieces = _pieces(rng)
    points = np.concatenate([piece.points for piece in pieces])
    low, high = points.min(axis=0), points.max(axis=0)
    turn, size = _random_rotation(rng), float(np.linalg.norm(high - low)) / float(rng.uniform(0.9, 1.4))
    placed = [Mesh((p.points - (low + high) / 2) @ turn.T / size, p.faces) for p in pieces]
    roles = [0, *rng.integers(ROLES, size=len(pieces) - 1).tolist()]
    parts = [Part(f"piece_{i}", refined(m, EDGE), r) for i, (m, r) in enumerate(zip(placed, roles, strict=True))]
    return animated_asset(Asset(tuple(parts)), name, seed_of("colours", name))


def _pieces(rng: np.random.Generator) -> list[Mesh]:
    pieces = [draw_piece(rng)]
    for _ in range(int(rng.choice(len(COUNTS), p=COUNTS))):
        grown = draw_piece(rng)
        factor, turn = float(np.exp(rng.uniform(*np.log(SIZES)))), _random_rotation(rng)
        moved = grown.points @ turn.T * factor
        on = pieces[int(rng.integers(len(pieces)))].points
        own = moved[int(rng.integers(len(moved)))] if rng.random() < 0.5 else moved.mean(axis=0)
        pieces.append(Mesh(moved - own + on[int(rng.integers(len(on)))], grown.faces))
    if rng.random() < BENT:
        pieces = _bent(pieces, rng)
    if rng.random() < MIRRORED:
        pieces += [mirrored(piece) for piece in pieces if np.abs(piece.points[:, 1]).max() > 0.02]
    return pieces


def _bent(pieces: list[Mesh], rng: np.random.Generator) -> list[Mesh]:
    """Taper, twist and bend along x by amounts that all pieces share."""
    taper, twist, bend = rng.uniform(-0.6, 0.6), rng.normal(0.0, 0.8), rng.normal(0.0, 0.25)

    def one(mesh: Mesh) -> Mesh:
        x = mesh.points[:, 0]
        c, s, wide = np.cos(twist * x), np.sin(twist * x), np.exp(taper * np.clip(x, -1.0, 1.0))
        y, z = mesh.points[:, 1] * wide, mesh.points[:, 2] * wide
        return Mesh(np.stack([x, c * y - s * z, s * y + c * z + bend * x * x], axis=1), mesh.faces)

    return [one(refined(piece, 0.1)) for piece in pieces]


def _random_rotation(rng: np.random.Generator) -> Float[np.ndarray, "3 3"]:
    """Haar-uniform."""
    return Rotation.random(random_state=rng).as_matrix()


def refined(mesh: Mesh, longest: float) -> Mesh:
    """Halve faces across their longest edges until none is longer than `longest` or there are `MOST_FACES`.

    The surface stays as it is. Points are not shared between the halves of different faces.
    """
    points, faces = mesh.points, mesh.faces
    while len(faces) < MOST_FACES:
        corner = points[faces]
        length = np.linalg.norm(np.roll(corner, -1, axis=1) - corner, axis=2)
        split = np.flatnonzero(length.max(axis=1) > longest)
        if not len(split):
            break
        start = length[split].argmax(axis=1)
        a, b, c = (faces[split, (start + i) % 3] for i in range(3))
        middle = len(points) + np.arange(len(split))
        points = np.concatenate([points, (points[a] + points[b]) / 2])
        kept = np.delete(faces, split, axis=0)
        faces = np.concatenate([kept, np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
    return Mesh(points, faces)
