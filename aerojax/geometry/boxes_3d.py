"""Boxes in space around an object: one along its body's axes, one along the world's. Metres, host-side."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

Triple = tuple[float, float, float]

CORNER_SIGNS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float64)
"""Corners in the order in which boxes list them: z changes fastest, then y, then x."""


@dataclass(frozen=True)
class OrientedBox:
    """The smallest box along a body's axes.

    centre: metres, world frame.
    size: full lengths along the body's x, y and z, metres.
    """

    centre: Triple
    size: Triple


@dataclass(frozen=True)
class AlignedBox:
    """The smallest box along the world's axes; `low` and `high` are its opposite corners, metres."""

    low: Triple
    high: Triple


def oriented_box(points: Float[np.ndarray, "point 3"], rotation: Float[np.ndarray, "3 3"]) -> OrientedBox:
    """The box along the axes of a body.

    Args:
        points: metres, world frame; at least one.
        rotation: `world_from_body`; its columns are the box's axes.
    """
    inside = points @ rotation
    low, high = inside.min(axis=0), inside.max(axis=0)
    return OrientedBox(_triple(rotation @ (low + high) / 2), _triple(high - low))


def aligned_box(points: Float[np.ndarray, "point 3"]) -> AlignedBox:
    """The box along the world's axes around points (metres, world frame; at least one)."""
    return AlignedBox(_triple(points.min(axis=0)), _triple(points.max(axis=0)))


def box_corners(box: OrientedBox, rotation: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "8 3"]:
    """Corners of a box in the order of `CORNER_SIGNS`, metres, world frame; `rotation` is `world_from_body`."""
    return np.array(box.centre) + CORNER_SIGNS * (np.array(box.size) / 2) @ rotation.T


def _triple(values: Float[np.ndarray, "3"]) -> Triple:
    x, y, z = values.tolist()
    return x, y, z
