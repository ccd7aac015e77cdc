"""Views for fitting and a held-out one, and how Gaussians look in them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import jax
import numpy as np
from jaxtyping import Array, Bool, Float

from aerojax.core.errors import UserError
from aerojax.core.types import Gaussians, View
from aerojax.gaussians.render import render
from aerojax.reconstruct.fit.photometric import background_colour, over_even_background


def split_views(views: View, valid: Bool[np.ndarray, "view"], held_out: int) -> tuple[View, View]:
    """Views for fitting, and the one for measuring.

    Args:
        views: of all cameras, leading axis `view`.
        valid: cameras that see the whole object; the others are left out.
        held_out: position of the second result's view among the valid ones; negative from their end.

    Raises:
        UserError: there are too few valid views.
    """
    index = np.flatnonzero(valid)
    if not -len(index) <= held_out < len(index):
        raise UserError(
            "out-of-range",
            f"held_out={held_out}: only {len(index)} cameras see the whole object",
            "choose a camera among them",
        )
    chosen = index[held_out]
    rest = index[index != chosen]
    return jax.tree.map(lambda x: x[rest], views), jax.tree.map(lambda x: x[chosen : chosen + 1], views)


def render_beside_views(
    gaussians: Gaussians, views: View, *, antialias: bool
) -> tuple[Float[Array, "view height width 3"], Float[Array, "view height width 3"]]:
    """Renderings of Gaussians and the images that they should equal, both over each view's mean background colour."""
    background = background_colour(views.rgb, views.mask)
    rendered = render(gaussians, views.camera, background=background, antialias=antialias).colour
    return rendered, over_even_background(views.rgb, views.mask, background)


def held_out_medians(fits: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Medians over captures of the held-out view: dB on the object, and gained over the hull. Nothing without fits.

    Args:
        fits: each with the `image_figures` of `fitted_held_out_view` and `hull_held_out_view`.
    """
    fitted, hull = (
        np.array([fit[f"{name}_held_out_view"]["foreground_psnr_db"] for fit in fits]) for name in ("fitted", "hull")
    )
    return {"median_db": float(np.median(fitted)), "median_gain_db": float(np.median(fitted - hull))} if fits else {}
