"""Photometric losses between images: L1 with structural dissimilarity, and PSNR on the object."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

WINDOW = 11
SIGMA = 1.5
"""Window of SSIM, pixels (Wang et al. 2004, §III-B)."""
C1, C2 = 0.01**2, 0.03**2
"""Stabilisers of SSIM for values in 0..1."""


def _blur(images: Float[Array, "plane height width"]) -> Float[Array, "plane h w"]:
    """Weighted means over all windows that lie inside the image."""
    offset = np.arange(WINDOW) - WINDOW // 2
    kernel = np.exp(-0.5 * (offset / SIGMA) ** 2)
    weights = jnp.asarray(kernel / kernel.sum(), images.dtype)
    rows = jax.lax.conv(images[:, None], weights[None, None, :, None], (1, 1), "VALID")
    return jax.lax.conv(rows, weights[None, None, None, :], (1, 1), "VALID")[:, 0]


def structural_similarity(
    a: Float[Array, "*batch height width 3"], b: Float[Array, "*batch height width 3"]
) -> Float[Array, ""]:
    """Mean SSIM of images in 0..1 over all windows, channels and images (Wang et al. 2004, Eq. 13).

    Both sides must be at least 11 pixels.
    """
    planes = [jnp.moveaxis(x, -1, -3).reshape(-1, *x.shape[-3:-1]) for x in (a, b)]
    x, y = planes
    mean_x, mean_y = _blur(x), _blur(y)
    variance_x, variance_y = _blur(x * x) - mean_x**2, _blur(y * y) - mean_y**2
    covariance = _blur(x * y) - mean_x * mean_y
    luminance = (2 * mean_x * mean_y + C1) / (mean_x**2 + mean_y**2 + C1)
    structure = (2 * covariance + C2) / (variance_x + variance_y + C2)
    return jnp.mean(luminance * structure)


def photometric_loss(
    predicted: Float[Array, "*batch height width 3"],
    target: Float[Array, "*batch height width 3"],
    *,
    dissimilarity: float = 0.2,
) -> Float[Array, ""]:
    """(1 - λ)·mean |C_pred - C_gt| + λ·(1 - SSIM) (thesis Eq. 3.9; Kerbl et al. 2023, Eq. 7)."""
    absolute = jnp.mean(jnp.abs(predicted - target))
    return (1 - dissimilarity) * absolute + dissimilarity * (1 - structural_similarity(predicted, target))


def certain_pixels(mask: Float[Array, "*batch height width"]) -> Bool[Array, "*batch height width"]:
    """Pixels whose 3×3 neighbourhood lies wholly inside or wholly outside the mask.

    A binary mask also holds the pixels that the object covers in part; their colour is half the backdrop's.
    """
    window = (1,) * (mask.ndim - 2) + (3, 3)
    ones = (1,) * mask.ndim
    least = jax.lax.reduce_window(mask, jnp.inf, jax.lax.min, window, ones, "SAME")
    most = jax.lax.reduce_window(mask, -jnp.inf, jax.lax.max, window, ones, "SAME")
    return (least > 0.99) | (most < 0.01)


def backdrop_colour(views_rgb: Float[Array, "view height width 3"], mask: Float[Array, "view height width"]) -> Array:
    """Mean colour (view, 3) of what surrounds the object in each crop; white where the crop shows nothing else."""
    outside = ((mask < 0.01) & certain_pixels(mask))[..., None]
    count = jnp.sum(outside, axis=(1, 2))
    mean = jnp.sum(jnp.where(outside, views_rgb, 0.0), axis=(1, 2)) / jnp.maximum(count, 1)
    return jnp.where(count > 0, mean, 1.0)


def over_backdrop(
    rgb: Float[Array, "view height width 3"], mask: Float[Array, "view height width"], backdrop: Float[Array, "view 3"]
) -> Float[Array, "view height width 3"]:
    """The images themselves on the object and its rim, the even backdrop elsewhere.

    A rim pixel already mixes object and backdrop, just as a drawing over that backdrop does; a binary mask cannot tell
    the shares.
    """
    near = (mask > 0.5) | ~certain_pixels(mask)
    return jnp.where(near[..., None], rgb, backdrop[:, None, None, :])


def foreground_psnr(
    predicted: Float[Array, "*batch height width 3"],
    target: Float[Array, "*batch height width 3"],
    mask: Float[Array, "*batch height width"],
) -> Float[Array, ""]:
    """Peak signal-to-noise ratio, dB, over the pixels that the object covers by more than half; peak 1."""
    inside = (mask > 0.5)[..., None]
    squares = jnp.sum(jnp.where(inside, (predicted - target) ** 2, 0.0))
    return -10 * jnp.log10(squares / jnp.maximum(3 * jnp.sum(inside), 1) + 1e-12)


def surround_psnr(
    predicted: Float[Array, "*batch height width 3"],
    target: Float[Array, "*batch height width 3"],
    mask: Float[Array, "*batch height width"],
) -> Float[Array, ""]:
    """`foreground_psnr` with four more pixels all round, where a shape that is too fat shows."""
    window, ones = (1,) * (mask.ndim - 2) + (9, 9), (1,) * mask.ndim
    grown = jax.lax.reduce_window((mask > 0.5).astype(mask.dtype), -jnp.inf, jax.lax.max, window, ones, "SAME")
    return foreground_psnr(predicted, target, grown)
