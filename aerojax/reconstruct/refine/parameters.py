"""Gaussians as the numbers that updates add to, and the bounded update."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from aerojax.core.types import SH_C0, Gaussians, pytree_dataclass
from aerojax.geometry.rotations import normalise, quaternion_multiply, rotation_from_quaternion
from aerojax.reconstruct.refine.config import Bounds

_LEAST_OPACITY = 1e-4
"""Bound of the logit at both ends."""


@pytree_dataclass
class Parameters:
    """Gaussians between updates.

    mean: metres. quaternion: unit. log_scale: of metres. logit: of the opacity. colour: sRGB.
    """

    mean: Float[Array, "gaussian 3"]
    quaternion: Float[Array, "gaussian 4"]
    log_scale: Float[Array, "gaussian 3"]
    logit: Float[Array, "gaussian"]
    colour: Float[Array, "gaussian 3"]


@pytree_dataclass
class Update:
    """What the network asks for, before bounds.

    shift: along the Gaussian's own axes and turn about them, log_scale along them, logit, colour: each in -1..1.
    along_cameras: world frame, a mean over the views of vectors whose entries along the camera's axes are in -1..1.
    error: of the colour, sRGB, to be taken off.
    """

    shift: Float[Array, "gaussian 3"]
    turn: Float[Array, "gaussian 3"]
    log_scale: Float[Array, "gaussian 3"]
    logit: Float[Array, "gaussian"]
    colour: Float[Array, "gaussian 3"]
    along_cameras: Float[Array, "gaussian 3"]
    error: Float[Array, "gaussian 3"]


def parameters_of(gaussians: Gaussians) -> Parameters:
    """Inverse of `gaussians_of` for opacities that are neither 0 nor 1."""
    opacity = jnp.clip(gaussians.opacity, _LEAST_OPACITY, 1 - _LEAST_OPACITY)
    return Parameters(
        gaussians.mean,
        gaussians.quaternion,
        jnp.log(jnp.maximum(gaussians.scale, 1e-9)),
        jnp.log(opacity) - jnp.log1p(-opacity),
        gaussians.sh[:, 0] * SH_C0 + 0.5,
    )


def gaussians_of(parameters: Parameters) -> Gaussians:
    """The Gaussians, with colour of degree 0."""
    sh = (parameters.colour[:, None] - 0.5) / SH_C0
    opacity = jax.nn.sigmoid(parameters.logit)
    return Gaussians(parameters.mean, parameters.quaternion, jnp.exp(parameters.log_scale), opacity, sh)


def turned(quaternion: Float[Array, "*batch 4"], angles: Float[Array, "*batch 3"]) -> Float[Array, "*batch 4"]:
    """Rotations after small turns about their own axes, radians: q ⊗ (1, angles/2), normalised."""
    small = jnp.concatenate([jnp.ones_like(angles[..., :1]), 0.5 * angles], axis=-1)
    return normalise(quaternion_multiply(quaternion, small))


def updated(now: Parameters, change: Update, pixel: Float[Array, "gaussian"], bounds: Bounds) -> Parameters:
    """The Gaussians after a bounded update.

    Args:
        now: the Gaussians before it.
        change: all zero changes nothing.
        pixel: metres that a pixel of the finest view spans at each Gaussian.
        bounds: what the change's ones mean.
    """
    own = jnp.einsum("gij,gj->gi", rotation_from_quaternion(now.quaternion), change.shift)
    # What is finer or coarser already, such as the hull's rods, may stay so.
    least = jnp.minimum(now.log_scale, jnp.log(bounds.least_scale * pixel)[:, None])
    most = jnp.maximum(now.log_scale, jnp.log(bounds.most_scale * pixel)[:, None])
    return Parameters(
        now.mean + bounds.shift * pixel[:, None] * (own + change.along_cameras),
        turned(now.quaternion, bounds.turn * change.turn),
        jnp.clip(now.log_scale + bounds.log_scale * change.log_scale, least, most),
        now.logit + bounds.logit * change.logit,
        now.colour + bounds.colour * change.colour - change.error,
    )
