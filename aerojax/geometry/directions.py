"""Directions that are even on a sphere."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64


def golden_spiral(height: Float64[np.ndarray, "direction"]) -> Float64[np.ndarray, "direction 3"]:
    """Unit vectors of given heights, each turned by the golden angle against the one before (González 2010).

    Even where the heights are in equal steps: over the whole sphere from -1 to 1, over a hemisphere from 0 to 1.
    """
    turn = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(len(height))
    flat = np.sqrt(1.0 - height * height)
    return np.stack([flat * np.cos(turn), flat * np.sin(turn), height], axis=1)
