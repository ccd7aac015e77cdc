"""Families of birds, and individuals drawn from them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from aerojax.simulate.assets.birds.shape import BirdShape
from aerojax.simulate.assets.birds.wingbeat import WingBeat, wingbeat_hertz
from aerojax.simulate.assets.families import Family, draw, read_families


@dataclass(frozen=True)
class BirdParameters:
    """One bird: its shape and how it beats its wings."""

    shape: BirdShape
    beat: WingBeat


@cache
def bird_families() -> dict[str, Family]:
    """Every family of birds by name, from the `families_*.toml` beside this file."""
    return read_families(Path(__file__).parent, (BirdShape, WingBeat), derived=("hertz",))


def draw_bird(family: str, rng: np.random.Generator) -> BirdParameters:
    """Draw one bird of a family; its wings beat at the frequency of Pennycuick's formula for its mass and span."""
    ranges = bird_families()[family].ranges
    shape = draw(BirdShape, ranges, rng)
    hertz = wingbeat_hertz(shape.mass, shape.span, shape.aspect)
    return BirdParameters(shape, draw(WingBeat, {**ranges, "hertz": hertz}, rng))
