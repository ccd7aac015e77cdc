"""sRGB and linear light (IEC 61966-2-1), for NumPy and JAX arrays alike."""

from __future__ import annotations

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
