"""Gaussians as short text: 24 bytes each, half floats and bytes, in base64."""

from __future__ import annotations

import base64
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, UInt8

from aerojax.view.viewer.content import Splats

BYTES_PER_SPLAT = 32
"""20 of ten half floats and four bytes of colour and opacity, times 4/3 for base64."""
_LARGEST_HALF = 65504.0


def pack_splats(splats: Splats, most: int) -> str:
    """Base64 of ten half floats a Gaussian (mean, quaternion, scale), then of four bytes each (red, green, blue,
    opacity, 255 = 1), little-endian.

    Gaussians with an attribute that is not finite or that half floats do not hold are left out; of more than `most`,
    evenly chosen ones remain.
    """
    halves = np.concatenate([splats.mean, splats.quaternion, splats.scale], axis=1)
    levels = np.concatenate([splats.rgb, splats.opacity[:, None]], axis=1)
    usable = np.isfinite(levels).all(axis=1) & (np.abs(halves) <= _LARGEST_HALF).all(axis=1)
    halves, levels = halves[usable], levels[usable]
    if len(halves) > most:
        chosen = np.linspace(0, len(halves) - 1, most).round().astype(int)
        halves, levels = halves[chosen], levels[chosen]
    packed = halves.astype("<f2").tobytes() + _bytes(levels).tobytes()
    return base64.b64encode(packed).decode("ascii")


def _bytes(levels: Float[np.ndarray, "gaussian 4"]) -> UInt8[np.ndarray, "gaussian 4"]:
    return np.round(255 * np.clip(levels, 0, 1)).astype(np.uint8)


def reach(splats: Sequence[Splats]) -> float:
    """Half the side, metres, of a cube about each frame's median that holds 99 % of the means along every axis."""
    means = [one.mean[np.isfinite(one.mean).all(axis=1)] for one in splats]
    found = [np.quantile(np.abs(m - np.median(m, axis=0)), 0.99, axis=0).max() for m in means if len(m)]
    return max(1e-3, 1.15 * float(max(found, default=1.0)))
