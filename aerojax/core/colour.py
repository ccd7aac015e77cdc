"""sRGB and linear light (IEC 61966-2-1), for NumPy and JAX arrays alike."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float32, UInt8

from aerojax.core.arrays import AnyArray, namespace


def srgb_from_linear(linear: AnyArray) -> AnyArray:
    """Encode linear light, 0..1; values below 0 go on along the straight part. Its gradient is finite everywhere."""
    xp = namespace(linear)
    # The power is never taken of what the straight part covers: its slope there has no bound.
    return xp.where(linear <= 0.0031308, 12.92 * linear, 1.055 * xp.maximum(linear, 0.0031308) ** (1 / 2.4) - 0.055)


def linear_from_srgb(encoded: AnyArray) -> AnyArray:
    """Linear light of sRGB values, 0..1; the inverse of `srgb_from_linear`."""
    xp = namespace(encoded)
    return xp.where(encoded <= 0.04045, encoded / 12.92, ((xp.maximum(encoded, 0.04045) + 0.055) / 1.055) ** 2.4)


def as_bytes(image: Float32[np.ndarray, "height width *channel"]) -> UInt8[np.ndarray, "height width *channel"]:
    """An sRGB image of 0..1, in colours or grey, as 0..255."""
    return np.round(255 * np.clip(image, 0, 1)).astype(np.uint8)


def as_floats(image: UInt8[np.ndarray, "height width 3"]) -> Float32[np.ndarray, "height width 3"]:
    """An sRGB image of 0..255 as 0..1."""
    return image.astype(np.float32) / 255
