"""Gaussians in another frame: covariance, rotation, rigid motion and uniform scaling."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from aerojax.core.errors import UserError
from aerojax.core.types import Gaussians
from aerojax.gaussians.sh import rotate_sh
from aerojax.geometry.cameras import transform_points
from aerojax.geometry.covariances import covariance_from_axes
from aerojax.geometry.rotations import canonical_sign, normalise, quaternion_from_rotation, quaternion_multiply


def covariance(gaussians: Gaussians) -> Float[Array, "*batch gaussian 3 3"]:
    """Σ = R diag(s²) Rᵀ of every Gaussian (Kerbl et al. 2023, Eq. 6), square metres, in the Gaussians' frame."""
    return covariance_from_axes(gaussians.quaternion, gaussians.scale)


def rotate(gaussians: Gaussians, rotation: Float[Array, "*turns rows columns"]) -> Gaussians:
    """Rotate about the frame's origin: means, axes and the view-dependent colour together.

    Args:
        gaussians: any batch.
        rotation: proper 3×3 rotation `dst_from_src`, not checked to be one; or a batch, whose leading axes broadcast
            against those of the Gaussians like NumPy's.

    Returns:
        Gaussians whose quaternions are unit with w ≥ 0.

    Raises:
        UserError: names shapes that do not fit.
    """
    if rotation.shape[-2:] != (3, 3):
        raise UserError("invalid", f"rotate: rotation has shape {rotation.shape}", "its last two axes must be 3, 3")
    if rotation.ndim == 2:
        return _rotated(gaussians, rotation)
    turns, scenes = rotation.shape[:-2], gaussians.opacity.shape[:-1]
    try:
        batch = jnp.broadcast_shapes(turns, scenes)
    except ValueError:
        problem = f"rotate: rotation is a batch of {turns}, gaussians one of {scenes}"
        raise UserError("invalid", problem, "make them equal, or one of them 1") from None
    flat = jnp.broadcast_to(rotation, (*batch, 3, 3)).reshape(-1, 3, 3)

    def spread(leaf: Array) -> Array:
        core = leaf.shape[len(scenes) :]
        return jnp.broadcast_to(leaf.reshape((1,) * (len(batch) - len(scenes)) + leaf.shape), (*batch, *core))

    each = jax.tree.map(lambda leaf: spread(leaf).reshape(len(flat), *leaf.shape[len(scenes) :]), gaussians)
    return jax.tree.map(lambda leaf: leaf.reshape(*batch, *leaf.shape[1:]), jax.vmap(_rotated)(each, flat))


def _rotated(gaussians: Gaussians, rotation: Float[Array, "3 3"]) -> Gaussians:
    quaternion = jnp.broadcast_to(quaternion_from_rotation(rotation), gaussians.quaternion.shape)
    return dataclasses.replace(
        gaussians,
        mean=gaussians.mean @ rotation.T,
        quaternion=canonical_sign(quaternion_multiply(quaternion, normalise(gaussians.quaternion))),
        sh=rotate_sh(gaussians.sh, rotation),
    )


def transform(gaussians: Gaussians, dst_from_src: Float[Array, "4 4"], *, scale: float | Array = 1.0) -> Gaussians:
    """Express Gaussians of one frame in another: x_dst = R (scale · x_src) + t.

    Args:
        gaussians: any batch, source frame.
        dst_from_src: rigid transform [R t; 0 1], metres.
        scale: uniform factor applied first, positive.
    """
    rotated = rotate(gaussians, dst_from_src[:3, :3])
    mean = transform_points(dst_from_src, gaussians.mean * scale)
    return dataclasses.replace(rotated, mean=mean, scale=gaussians.scale * scale)
