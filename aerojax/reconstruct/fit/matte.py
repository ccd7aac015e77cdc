"""Alpha mattes of views: what a fit needs to draw an object over any background.

A Gaussian splat blends display (sRGB) values, a camera blends light. A pixel's *matte* a is the share that explains it
the splat's way: I = a·F + (1 - a)·B in sRGB, where F is the object's own colour and B the background's. A dark object
that covers half a bright pixel has a below one half.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from aerojax.capture.format import Capture
from aerojax.capture.frames import read_coverage, read_rgb
from aerojax.core.colour import linear_from_srgb, srgb_from_linear
from aerojax.core.images import dilate, off_boundary
from aerojax.core.types import Observation, View
from aerojax.reconstruct.crop import crop_image
from aerojax.reconstruct.fit.photometric import background_colour

_PRIOR_WEIGHT = 0.01
"""Squared colour contrast at which the prior share counts as much as the colours."""
_COLOUR_WINDOW = 9
"""Side of the window, pixels, in which a boundary pixel looks for the object's own colour."""


def matte_from_coverage(
    rgb: Float[Array, "*batch height width 3"],
    coverage: Float[Array, "*batch height width"],
    background: Float[Array, "*batch height width 3"],
) -> Float[Array, "*batch height width"]:
    """The share with which an sRGB blend shows what light blended with `coverage`; where they do not differ, coverage.

    Args:
        rgb, background: sRGB, 0..1.
        coverage: share of each pixel that the object covers, 0..1.
    """
    share = coverage[..., None]
    light = (linear_from_srgb(rgb) - (1 - share) * linear_from_srgb(background)) / jnp.maximum(share, 1 / 255)
    matte = _blend_share(rgb, srgb_from_linear(jnp.clip(light, 0.0, 1.0)), background, coverage)
    return jnp.where(coverage > 0.999, 1.0, jnp.where(coverage < 1e-3, 0.0, matte))


def matte_from_mask(
    rgb: Float[Array, "view height width 3"], mask: Float[Array, "view height width"]
) -> Float[Array, "view height width"]:
    """The matte from a binary mask: boundary pixels between the mean colours of object and background near them.

    Parts thinner than three pixels have no pixel off their boundary; away from any, the mask itself is the answer.
    """
    known = off_boundary(mask)
    inside = (known & (mask > 0.5)).astype(rgb.dtype)
    window, ones = (1, _COLOUR_WINDOW, _COLOUR_WINDOW), (1, 1, 1)

    def window_sum(values: Float[Array, "view height width"]) -> Array:
        return jax.lax.reduce_window(values, 0.0, jax.lax.add, window, ones, "SAME")

    count = window_sum(inside)
    sums = jnp.stack([window_sum(rgb[..., k] * inside) for k in range(3)], axis=-1)
    object_colour = sums / jnp.maximum(count, 1.0)[..., None]
    background = jnp.broadcast_to(background_colour(rgb, mask)[:, None, None], rgb.shape)
    return jnp.where(known | (count < 1), mask, _blend_share(rgb, object_colour, background, mask))


def matted_views(capture: Capture, seen: Observation) -> View:
    """An observation's views with mattes as their masks: from the capture's coverage where it has it, else estimated.

    Args:
        capture: where the observation comes from.
        seen: crops of all cameras, and how they were cut.
    """
    views = seen.views
    mask = matte_from_mask(views.rgb, views.mask)
    backgrounds = background_colour(views.rgb, views.mask)
    for index in map(int, np.flatnonzero(seen.valid)):
        coverage, image = read_coverage(capture, index, seen.frame), read_rgb(capture, index, seen.frame)
        if coverage is None or image is None:
            continue
        background = jnp.broadcast_to(backgrounds[index], image.shape)
        matte = np.asarray(matte_from_coverage(jnp.asarray(image), jnp.asarray(coverage), background))
        cut = crop_image(matte, seen.crop_from_image[index], size=views.camera.width)
        # Coverage is of all objects; others, and clutter, are not within two pixels of this one's mask.
        mask = mask.at[index].set(jnp.where(dilate(views.mask[index], 2) > 0.01, cut, 0.0))
    return View(views.rgb, mask, views.camera)


def _blend_share(rgb: Array, foreground: Array, background: Array, prior: Array) -> Array:
    """The point between background and foreground colour that is nearest to a pixel's, 0..1, drawn to `prior`."""
    contrast = foreground - background
    along = jnp.sum((rgb - background) * contrast, axis=-1) + _PRIOR_WEIGHT * prior
    return jnp.clip(along / (jnp.sum(contrast * contrast, axis=-1) + _PRIOR_WEIGHT), 0.0, 1.0)
