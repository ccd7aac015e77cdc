"""How a clip's object moves and changes from frame to frame, as numbers that no rotation of the whole clip changes."""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

MOTION_FEATURES = 6
_REST = 1e-2
"""Speeds far below this share of the object's radius a frame have no direction worth a number: their cosines fade."""


def motion_invariants(
    columns: Float[Array, "time token 14"],
    weights: Float[Array, "time token"],
    centre: Float[Array, "time 3"],
    radius: Float[Array, "time"],
) -> Float[Array, "time 6"]:
    """Speed, turn and change of shape since the frame before; 0 in the first frame and beside frames without tokens.

    With velocity v (radii a frame) and second moments S of the frame's tokens (radii squared): log(1 + |v|); cosine of
    the turn; vᵀSv/|v|², how far the body reaches along its flight; overlap tr(SS')/(|S||S'|) with the frame before;
    |SS' - S'S|/(|S||S'|), how far it has turned; log of the ratio of sizes. All are invariant when the clip is turned
    or moved as a whole, and not when each frame is turned by itself.

    Args:
        columns: Gaussians, metres, world frame.
        weights: of tokens, 0 for those that do not count.
        centre: weighted mean of each frame.
        radius: that of each frame's normalisation, metres.
    """
    seen = weights.sum(axis=1) > 0
    offset = (columns[..., :3] - centre[:, None]) / radius[:, None, None]
    share = weights / jnp.maximum(weights.sum(axis=1, keepdims=True), 1e-9)
    moment = jnp.einsum("tn,tni,tnj->tij", share, offset, offset)
    pair = seen[1:] & seen[:-1]
    velocity = jnp.where(pair[:, None], (centre[1:] - centre[:-1]) / radius[1:, None], 0.0)
    square = jnp.sum(velocity**2, axis=-1)
    speed = jnp.sqrt(square + 1e-12)
    turn = jnp.sum(velocity[1:] * velocity[:-1], axis=-1) / (speed[1:] * speed[:-1] + _REST**2)
    along = jnp.einsum("ti,tij,tj->t", velocity, moment[1:], velocity) / (square + _REST**2)
    now, before = moment[1:], moment[:-1]
    norms = _frobenius(now) * _frobenius(before) + 1e-9
    product = now @ before
    overlap = jnp.trace(product, axis1=1, axis2=2) / norms
    turned = _frobenius(product - product.transpose(0, 2, 1)) / norms
    sizes = jnp.log(jnp.trace(moment, axis1=1, axis2=2) + 1e-6)
    first = jnp.zeros(1, columns.dtype)
    rows = jnp.stack(
        [jnp.log1p(speed), jnp.concatenate([first, turn]), along, overlap, turned, sizes[1:] - sizes[:-1]], axis=1
    )
    return jnp.concatenate([jnp.zeros((1, MOTION_FEATURES), columns.dtype), jnp.where(pair[:, None], rows, 0.0)])


def _frobenius(matrix: Float[Array, "time 3 3"]) -> Float[Array, "time"]:
    return jnp.sqrt(jnp.sum(matrix**2, axis=(1, 2)) + 1e-12)


def median_distance(distance: Float[Array, "time token"], mask: Bool[Array, "time token"]) -> Float[Array, ""]:
    """Median over all valid tokens, the lower one of an even number; 0 without any."""
    ordered = jnp.sort(jnp.where(mask, distance, jnp.inf).ravel())
    count = mask.sum()
    return jnp.where(count > 0, ordered[jnp.maximum(count - 1, 0) // 2], 0.0)
