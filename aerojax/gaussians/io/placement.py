"""Gaussians far from the world's origin: float32 numbers about a place that float64 gives.

At a UTM northing of 5.6e6 m the steps of float32 are half a metre, at ECEF coordinates likewise. Files therefore hold
Gaussians about an origin of their own, and the origin beside them in double precision.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float64

from aerojax.core.errors import UserError
from aerojax.core.types import Gaussians
from aerojax.gaussians.rotate import transform

FAR = 8192.0
"""Metres from the origin beyond which float32 positions are coarser than a millimetre (2¹³ m · 2⁻²³)."""


def place(
    gaussians: Gaussians, world_from_local: Float64[np.ndarray, "4 4"], *, scale: float = 1.0
) -> tuple[Gaussians, Float64[np.ndarray, "3"]]:
    """Turn Gaussians to the axes of the world, about an origin near them.

    Args:
        gaussians: local frame.
        world_from_local: rigid transform, metres.
        scale: uniform factor applied first.

    Returns:
        The Gaussians and their origin: world = origin + mean. The origin is zero up to `FAR`, whole metres beyond.
    """
    translation = world_from_local[:3, 3]
    origin = np.round(translation) if np.abs(translation).max() > FAR else np.zeros(3)
    near = np.array(world_from_local)
    near[:3, 3] -= origin
    if np.array_equal(near[:3, :3], np.eye(3)):  # exact, and without compiling a rotation of nothing
        moved = np.asarray(gaussians.mean, np.float64) * scale + near[None, :3, 3]
        dtype = gaussians.mean.dtype
        changed = {"mean": jnp.asarray(moved, dtype), "scale": gaussians.scale * jnp.asarray(scale, dtype)}
        return dataclasses.replace(gaussians, **changed), origin
    return transform(gaussians, jnp.asarray(near, gaussians.mean.dtype), scale=scale), origin


def refuse_far(path: Path | str, origin: Float64[np.ndarray, "3"], reader: str) -> None:
    """Refuse to drop an origin that is not zero.

    Args:
        path: of the file, for the message.
        origin: of its Gaussians.
        reader: name of the function that gives the origin too.

    Raises:
        UserError: the origin is not zero.
    """
    if np.any(origin):
        raise UserError(
            "out-of-range",
            f"{path}: its Gaussians lie about {[float(x) for x in np.round(origin)]} m from the world's origin, where "
            "float32 has no millimetres",
            f"read it with {reader}, which gives that place beside them",
        )
