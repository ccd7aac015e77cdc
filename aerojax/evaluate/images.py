"""How near renderings of an object come to its images: PSNR where the object is, and SSIM of the whole crop."""

from __future__ import annotations

from jaxtyping import Array, Float

from aerojax.core.images import dilate, off_boundary, peak_signal_to_noise, structural_similarity

SURROUND = 4
"""Pixels around the mask in which a shape that is too fat shows."""


def image_figures(
    rendered: Float[Array, "view height width 3"],
    target: Float[Array, "view height width 3"],
    mask: Float[Array, "view height width"],
) -> dict[str, float]:
    """PSNR on the object, there and four pixels around it, and off its boundary; SSIM of the whole images.

    Args:
        rendered, target: sRGB, 0..1, over the same background; at least 11 pixels a side.
        mask: the object's coverage, 0..1; it counts where it is above one half.
    """
    surround = dilate((mask > 0.5).astype(mask.dtype), SURROUND)
    interior = mask * off_boundary(mask).astype(mask.dtype)
    return {
        "foreground_psnr_db": float(peak_signal_to_noise(rendered, target, mask)),
        "surround_psnr_db": float(peak_signal_to_noise(rendered, target, surround)),
        "interior_psnr_db": float(peak_signal_to_noise(rendered, target, interior)),
        "ssim": float(structural_similarity(rendered, target)),
    }
