"""Airplanes of a family and seed, and their parts."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from aerojax.simulate.assets.airplanes.asset import build_airplane
from aerojax.simulate.assets.airplanes.families import draw_airplane
from aerojax.simulate.usd.authoring import Asset


def built_airplane(family: str, seed: int = 0, **changes: Any) -> Asset:
    """One airplane; `changes` replace what was drawn."""
    rng = np.random.default_rng(seed)
    return build_airplane(replace(draw_airplane(family, rng), **changes), rng)


def part_points(asset: Asset, name: str) -> np.ndarray:
    """Vertices of one part."""
    return next(p.mesh.points for p in asset.parts if p.name == name)
