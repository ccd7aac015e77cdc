"""What the released code does to a frame of Gaussians before its network sees any of it."""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Array, Float

from aerojax.core.types import SH_C0
from aerojax.geometry.rotations import canonical_sign, normalise


def normalise_published(columns: Float[Array, "*batch token 14"]) -> Float[Array, "*batch token 14"]:
    """The released code's preprocessing of one whole frame, before any subset is drawn.

    Positions into the unit ball about the unweighted mean; scales divided by the same radius and then by the largest
    norm of a scale vector; opacity to [-1, 1]; colour 2·clip(C0·f_dc, ±½)/√3; quaternion with w ≥ 0.
    """
    position = columns[..., :3] - columns[..., :3].mean(axis=-2, keepdims=True)
    radius = _largest_norm(position)
    scale = columns[..., 7:10] / radius
    scale = scale / _largest_norm(scale)
    quaternion = canonical_sign(normalise(columns[..., 3:7]))
    colour = jnp.clip(SH_C0 * columns[..., 11:14], -0.5, 0.5) * (2 / 3**0.5)
    parts = (position / radius, quaternion, scale, 2 * columns[..., 10:11] - 1, colour)
    return jnp.concatenate(parts, axis=-1)


def _largest_norm(vectors: Float[Array, "*batch token 3"]) -> Float[Array, "*batch 1 1"]:
    norms = jnp.linalg.norm(vectors, axis=-1, keepdims=True)
    return jnp.maximum(norms.max(axis=-2, keepdims=True), 1e-12)
