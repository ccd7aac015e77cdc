"""Families of multicopters, and individuals drawn from them."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

from aerojax.simulate.assets.families import Family, draw, read_families
from aerojax.simulate.assets.multicopters.layout import MulticopterParameters


@cache
def multicopter_families() -> dict[str, Family]:
    """Every family of multicopters by name, from the `families_*.toml` beside this file."""
    return read_families(Path(__file__).parent, (MulticopterParameters,))


def draw_multicopter(family: str, rng: np.random.Generator) -> MulticopterParameters:
    """Draw one multicopter of a family."""
    return draw(MulticopterParameters, multicopter_families()[family].ranges, rng)
