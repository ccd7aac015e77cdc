"""One colour a face, for renderers that need no texture."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from aerojax.core.colour import linear_from_srgb, srgb_from_linear
from aerojax.simulate.assets.mesh.parts import Part
from aerojax.simulate.assets.paint import patterns
from aerojax.simulate.assets.paint.materials import GLASS, corner_values, surface_at

_SHARES = np.array([[1, 1, 1], [4, 1, 1], [1, 4, 1], [1, 1, 4]]) / np.array([[3], [6], [6], [6]])
"""Barycentric places at which a face's paint is read: its middle and half way to each corner."""


def face_colours(parts: tuple[Part, ...], seed: int) -> Float[np.ndarray, "face 3"]:
    """Mean colour of every face (sRGB, 0..1) of the paint that `bake_texture` bakes for the same parts and seed.

    Args:
        parts: in the rest pose, body frame, metres.
        seed: of palette and patterns.
    """
    paint = patterns.draw_paint(seed)
    linear = []
    for part in parts:
        samples = np.einsum("sc,fci->sfi", _SHARES, corner_values(part, parts))
        surface = surface_at(samples.reshape(-1, samples.shape[-1]))
        srgb = patterns.colours(paint, part.role, surface, plain=part.name in GLASS)
        linear.append(linear_from_srgb(srgb).reshape(len(_SHARES), -1, 3).mean(axis=0))
    return srgb_from_linear(np.concatenate(linear))
