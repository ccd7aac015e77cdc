"""How far logits drift when nothing but the frame of reference or the choice of a quaternion changes."""

from __future__ import annotations

import itertools
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from aerojax.geometry.rotations import canonical_sign, normalise, quaternion_multiply

BANDS = ((1e-4, "HOLDS"), (1e-2, "MARGINAL"))
"""Largest drift of each verdict (thesis §6.5.9); above the last it is a LEAK."""


def verdict(drift: float) -> str:
    """HOLDS, MARGINAL or LEAK; a drift that is not a number is a leak."""
    return next((name for limit, name in BANDS if drift <= limit), "LEAK")


def drift_figures(
    original: Float[np.ndarray, "clip label"],
    unturned: Float[np.ndarray, "clip label"],
    turned: Float[np.ndarray, "pass clip label"],
) -> dict[str, Any]:
    """The diagnostic of thesis §6.5.9.

    Δ_max is the largest change of any logit of any clip; the class cannot change while the smallest margin between a
    clip's two largest logits exceeds 2·Δ_max (Eq. 5.18).

    Args:
        original: logits of the clips as they are.
        unturned: logits after the identity through the same code as every other rotation: the noise floor.
        turned: logits after each rotation.
    """
    change = np.abs(turned - original)
    ordered = np.sort(original, axis=1)
    margin, largest = float((ordered[:, -1] - ordered[:, -2]).min()), float(change.max())
    flips = int(np.sum(np.argmax(turned, axis=-1) != np.argmax(original, axis=-1)))
    spread = float(original.std(axis=0).mean())
    return {
        "passes": int(change.shape[0] * change.shape[1]),
        "largest_drift": largest,
        "median_drift": float(np.median(change.max(axis=-1))),
        "noise_floor": float(np.abs(unturned - original).max()),
        "logit_deviation": spread,
        "relative_drift": largest / spread if spread > 0 else None,
        "smallest_margin": margin,
        "safety": margin / (2 * largest) if largest > 0 else None,
        "guaranteed": bool(margin > 2 * largest),
        "flips": flips,
        "flip_rate": flips / (change.shape[0] * change.shape[1]),
        "verdict": verdict(largest),
    }


def axis_relabellings() -> tuple[Float[np.ndarray, "24 4"], Int[np.ndarray, "24 3"]]:
    """The 24 proper rotations that permute and flip the axes: unit quaternions, and which scale each axis takes.

    An ellipsoid with quaternion q and scales s is also the one with q ⊗ q_k and s[order_k].
    """
    quaternions, orders = [], []
    half = np.sqrt(0.5)
    units = [np.eye(4)[i] for i in range(4)]
    units += [np.array(signs) / 2 for signs in itertools.product((1,), (1, -1), (1, -1), (1, -1))]
    for first, second in itertools.combinations(range(4), 2):
        units += [half * (np.eye(4)[first] + sign * np.eye(4)[second]) for sign in (1, -1)]
    for w, x, y, z in units:
        matrix = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )
        quaternions.append([w, x, y, z])
        # Column k of R·P is the column of R whose row holds P's entry, with that column's scale.
        orders.append(np.abs(matrix).argmax(axis=0))
    return np.array(quaternions), np.array(orders)


def relabel_axes(
    columns: Float[Array, "*batch token 14"], quaternion: Float[Array, "token 4"], order: Int[Array, "token 3"]
) -> Float[Array, "*batch token 14"]:
    """The same ellipsoids by other quaternions and orders of scales, rows of `axis_relabellings`, one a token."""
    turn = jnp.broadcast_to(jnp.asarray(quaternion, columns.dtype), (*columns.shape[:-1], 4))
    turned = canonical_sign(quaternion_multiply(normalise(columns[..., 3:7]), turn))
    place = jnp.broadcast_to(order, (*columns.shape[:-1], 3))
    scale = jnp.take_along_axis(columns[..., 7:10], place, axis=-1)
    return jnp.concatenate([columns[..., :3], turned, scale, columns[..., 10:]], axis=-1)
