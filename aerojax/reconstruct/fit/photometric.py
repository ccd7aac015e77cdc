"""The photometric loss of a fit, and views whose background is one even colour."""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Array, Float

from aerojax.core.images import off_boundary, structural_similarity


def photometric_loss(
    predicted: Float[Array, "*batch height width 3"],
    target: Float[Array, "*batch height width 3"],
    *,
    dssim_weight: float | Float[Array, ""] = 0.2,
) -> Float[Array, ""]:
    """(1 - λ)·mean |C_pred - C_gt| + λ·(1 - SSIM), λ = `dssim_weight` (thesis Eq. 3.9; Kerbl et al. 2023, Eq. 7)."""
    absolute = jnp.mean(jnp.abs(predicted - target))
    return (1 - dssim_weight) * absolute + dssim_weight * (1 - structural_similarity(predicted, target))


def background_colour(
    rgb: Float[Array, "view height width 3"], mask: Float[Array, "view height width"]
) -> Float[Array, "view 3"]:
    """Mean colour of what surrounds the object in each crop; white where the crop shows nothing else."""
    outside = ((mask < 0.01) & off_boundary(mask))[..., None]
    count = jnp.sum(outside, axis=(1, 2))
    mean = jnp.sum(jnp.where(outside, rgb, 0.0), axis=(1, 2)) / jnp.maximum(count, 1).astype(rgb.dtype)
    return jnp.where(count > 0, mean, 1.0)


def over_even_background(
    rgb: Float[Array, "view height width 3"],
    mask: Float[Array, "view height width"],
    background: Float[Array, "view 3"],
) -> Float[Array, "view height width 3"]:
    """The images themselves on the object and its boundary, the given colour elsewhere.

    A boundary pixel already mixes object and background, just as a rendering over that background does; a binary mask
    cannot tell the shares.
    """
    near = (mask > 0.5) | ~off_boundary(mask)
    return jnp.where(near[..., None], rgb, background[:, None, None, :])
