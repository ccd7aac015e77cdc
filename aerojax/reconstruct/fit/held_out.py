"""Fitting views and a held-out one, and how Gaussians look in them."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from aerojax.core.errors import UserError
from aerojax.core.types import Gaussians, View
from aerojax.pipeline.offline import FrameImages
from aerojax.reconstruct.fit.optimise import draw_views
from aerojax.reconstruct.fit.photometric import (
    backdrop_colour,
    certain_pixels,
    foreground_psnr,
    over_backdrop,
    structural_similarity,
    surround_psnr,
)


def split_views(seen: FrameImages, held_out: int) -> tuple[View, View]:
    """Views for fitting, and the one for measuring."""
    index = np.flatnonzero(seen.valid)
    if not -len(index) <= held_out < len(index):
        raise UserError(
            "out-of-range",
            f"held_out={held_out}: only {len(index)} cameras see the whole object",
            "choose a camera among them",
        )
    chosen = index[held_out]
    rest = index[index != chosen]
    return jax.tree.map(lambda x: x[rest], seen.views), jax.tree.map(lambda x: x[chosen : chosen + 1], seen.views)


def measure(gaussians: Gaussians, views: View, antialias: bool) -> tuple[dict[str, float], np.ndarray]:
    """PSNR on the object and inside its rim, and SSIM, over each view's backdrop; and truth above drawing."""
    backdrop = backdrop_colour(views.rgb, views.mask)
    drawn = draw_views(gaussians, views.camera, backdrop, antialias=antialias)
    target = over_backdrop(views.rgb, views.mask, backdrop)
    figures = {
        "foreground_psnr_db": float(foreground_psnr(drawn, target, views.mask)),
        "surround_psnr_db": float(surround_psnr(drawn, target, views.mask)),
        "interior_psnr_db": float(foreground_psnr(drawn, target, views.mask * certain_pixels(views.mask))),
        "ssim": float(structural_similarity(drawn, target)),
    }
    return figures, np.concatenate([np.concatenate(list(x), axis=1) for x in (target, jnp.clip(drawn, 0, 1))])
