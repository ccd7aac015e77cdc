"""Covariances of 3D Gaussians: Σ = R diag(σ²) Rᵀ and back."""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Array, Float

from aerojax.geometry.rotations import quaternion_from_rotation, rotation_from_quaternion


def covariance_from_axes(
    quaternion: Float[Array, "*batch 4"], scale: Float[Array, "*batch 3"]
) -> Float[Array, "*batch 3 3"]:
    """Σ = R diag(s²) Rᵀ (Kerbl et al. 2023, Eq. 6), square metres; the quaternion is normalised first."""
    half = rotation_from_quaternion(quaternion) * scale[..., None, :]
    return half @ jnp.swapaxes(half, -1, -2)


def axes_from_covariance(
    covariance: Float[Array, "*batch 3 3"],
) -> tuple[Float[Array, "*batch 4"], Float[Array, "*batch 3"]]:
    """Principal axes of Σ: a unit quaternion and standard deviations in descending order, metres.

    The axes' signs are arbitrary (24 proper quaternions represent one ellipsoid); the frame is made right-handed.
    Negative eigenvalues from rounding become zero.
    """
    values, vectors = jnp.linalg.eigh(covariance)
    values, vectors = values[..., ::-1], vectors[..., ::-1]
    handedness = jnp.sign(jnp.linalg.det(vectors))[..., None]
    vectors = vectors.at[..., :, 2].multiply(handedness)
    return quaternion_from_rotation(vectors), jnp.sqrt(jnp.maximum(values, 0.0))
