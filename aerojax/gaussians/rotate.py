"""Rigid motion of Gaussians: means and axes turn together."""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Array, Float

from aerojax.geometry.cameras import transform_points
from aerojax.geometry.rotations import canonical_sign, quaternion_from_rotation, quaternion_multiply
from aerojax.types import Gaussians


def transform(gaussians: Gaussians, dst_from_src: Float[Array, "4 4"]) -> Gaussians:
    """Express Gaussians of one frame (degree-0 colour) in another.

    Args:
        gaussians: in the source frame.
        dst_from_src: rigid transform, metres.
    """
    turn = quaternion_from_rotation(dst_from_src[:3, :3])
    quaternion = quaternion_multiply(jnp.broadcast_to(turn, gaussians.quaternion.shape), gaussians.quaternion)
    return Gaussians(
        mean=transform_points(dst_from_src, gaussians.mean),
        quaternion=canonical_sign(quaternion),
        scale=gaussians.scale,
        opacity=gaussians.opacity,
        sh=gaussians.sh,
    )
