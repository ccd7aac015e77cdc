"""Outliers as identities: any number of each kind, each from its seed alone."""

from __future__ import annotations

import numpy as np

from aerojax.simulate.assets.mesh.parts import Part
from aerojax.simulate.assets.mesh.shapes import Mesh
from aerojax.simulate.assets.outliers.kinds import KINDS
from aerojax.simulate.assets.paint.patterns import ROLES
from aerojax.simulate.usd.authoring import Asset

LENGTHS = (0.8, 1.3)
"""Metres: the largest extent of an outlier, about as large as the individuals of the classes are."""


def outlier_asset(kind: str, seed: int) -> Asset:
    """Draw an individual of a kind, its middle at the origin; nothing of it moves by itself.

    Args:
        kind: a name of `KINDS`.
        seed: of everything but the colours.
    """
    rng = np.random.default_rng(seed)
    mesh = KINDS[kind].draw(rng)
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    size = float(rng.uniform(*LENGTHS)) / float((high - low).max())
    placed = Mesh((mesh.points - (low + high) / 2) * size, mesh.faces)
    return Asset((Part("thing", placed, int(rng.integers(ROLES))),))
