"""Families of airplanes, and individuals drawn from them."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

from aerojax.simulate.assets.airplanes.shape import AirplaneParameters
from aerojax.simulate.assets.families import Family, draw, read_families


@cache
def airplane_families() -> dict[str, Family]:
    """Every family of airplanes by name, from the `families_*.toml` beside this file."""
    return read_families(Path(__file__).parent, (AirplaneParameters,))


def draw_airplane(family: str, rng: np.random.Generator) -> AirplaneParameters:
    """Draw one airplane of a family."""
    return draw(AirplaneParameters, airplane_families()[family].ranges, rng)
