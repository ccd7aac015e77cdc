"""Families of helicopters, and individuals drawn from them."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

from aerojax.simulate.assets.families import Family, draw, read_families
from aerojax.simulate.assets.helicopters.layout import HelicopterParameters


@cache
def helicopter_families() -> dict[str, Family]:
    """Every family of helicopters by name, from the `families_*.toml` beside this file."""
    return read_families(Path(__file__).parent, (HelicopterParameters,))


def draw_helicopter(family: str, rng: np.random.Generator) -> HelicopterParameters:
    """Draw one helicopter of a family."""
    return draw(HelicopterParameters, helicopter_families()[family].ranges, rng)
