"""Shares of object and backdrop in each pixel: what a fit needs to draw an object over any backdrop.

A Gaussian splat blends display (sRGB) values, a camera blends light. The *apparent opacity* a of a pixel is the share
that explains it the splat's way: I = a·F + (1 - a)·B in sRGB, where F is the object's own colour and B the backdrop's.
A dark object that covers half a bright pixel has a below one half.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from aerojax.capture.format import Capture
from aerojax.capture.frames import read_coverage, read_rgb
from aerojax.core.types import View
from aerojax.geometry.boxes import Box
from aerojax.reconstruct.crop import crop_cameras, crop_image
from aerojax.reconstruct.fit.photometric import backdrop_colour, certain_pixels

_FAINT = 0.01
"""Squared colour contrast at which the known share counts as much as the colours."""
_REACH = 9
"""Side of the window, pixels, in which a rim pixel looks for the object's own colour."""


def apparent_opacity(
    rgb: Float[Array, "*batch height width 3"],
    coverage: Float[Array, "*batch height width"],
    backdrop: Float[Array, "*batch height width 3"],
) -> Float[Array, "*batch height width"]:
    """The share with which an sRGB blend shows what light blended with `coverage`; where they do not differ, coverage.

    Args:
        rgb, backdrop: sRGB, 0..1.
        coverage: share of each pixel that the object covers, 0..1.
    """
    share = coverage[..., None]
    light = (_light(rgb) - (1 - share) * _light(backdrop)) / jnp.maximum(share, 1 / 255)
    opacity = _share(rgb, _display(light), backdrop, coverage)
    return jnp.where(coverage > 0.999, 1.0, jnp.where(coverage < 1e-3, 0.0, opacity))


def estimated_opacity(rgb: Float[Array, "view height width 3"], mask: Float[Array, "view height width"]) -> Array:
    """Apparent opacity from a binary mask: rim pixels between the mean colours of object and backdrop near them.

    Parts thinner than three pixels have no certain pixel; away from any, the mask itself is the answer.
    """
    certain = certain_pixels(mask)
    inside = (certain & (mask > 0.5)).astype(rgb.dtype)
    window, ones = (1, _REACH, _REACH), (1, 1, 1)

    def near(values: Float[Array, "view height width"]) -> Array:
        return jax.lax.reduce_window(values, 0.0, jax.lax.add, window, ones, "SAME")

    count = near(inside)
    own = jnp.stack([near(rgb[..., k] * inside) for k in range(3)], axis=-1) / jnp.maximum(count, 1.0)[..., None]
    backdrop = jnp.broadcast_to(backdrop_colour(rgb, mask)[:, None, None], rgb.shape)
    return jnp.where(certain | (count < 1), mask, _share(rgb, own, backdrop, mask))


def matted_views(
    capture: Capture, frame: int, views: View, valid: Bool[np.ndarray, "camera"], boxes: tuple[Box | None, ...]
) -> View:
    """The views with apparent opacity as their mask: from the capture's coverage where it has it, else estimated.

    Args:
        capture, frame: where the views come from.
        views: crops of all cameras, leading axis `camera`.
        valid, boxes: which cameras count, and the object's box in the images of these, as the crops were cut.
    """
    mask = estimated_opacity(views.rgb, views.mask)
    size = views.camera.width
    for index in np.flatnonzero(valid):
        coverage, image = read_coverage(capture, int(index), frame), read_rgb(capture, int(index), frame)
        if coverage is None or image is None:
            continue
        camera, box = capture.cameras[index], np.asarray(boxes[index], np.float64)
        crop = crop_cameras(camera.K[None], camera.world_from_cam[None], box[None], size=size)
        crop_from_image = np.asarray(crop.crop_from_image[0])
        backdrop = jnp.broadcast_to(backdrop_colour(views.rgb, views.mask)[index], image.shape)
        opacity = np.asarray(apparent_opacity(jnp.asarray(image), jnp.asarray(coverage), backdrop))
        cut = crop_image(opacity, crop_from_image, size=size)
        # Coverage is of all objects; others, and clutter, are not near this one's mask.
        mask = mask.at[index].set(jnp.where(_grown(views.mask[index]) > 0.01, cut, 0.0))
    return View(views.rgb, mask, views.camera)


def _share(rgb: Array, own: Array, backdrop: Array, known: Array) -> Array:
    """The point between backdrop and own colour that is nearest to a pixel's, 0..1."""
    across = own - backdrop
    along = jnp.sum((rgb - backdrop) * across, axis=-1) + _FAINT * known
    return jnp.clip(along / (jnp.sum(across * across, axis=-1) + _FAINT), 0.0, 1.0)


def _grown(mask: Float[Array, "height width"]) -> Float[Array, "height width"]:
    """The mask with two more pixels all round."""
    return jax.lax.reduce_window(mask, -jnp.inf, jax.lax.max, (5, 5), (1, 1), "SAME")


def _light(encoded: Array) -> Array:
    """sRGB to linear light (IEC 61966-2-1)."""
    return jnp.where(encoded <= 0.04045, encoded / 12.92, ((jnp.maximum(encoded, 0.0) + 0.055) / 1.055) ** 2.4)


def _display(light: Array) -> Array:
    """Linear light to sRGB, 0..1."""
    light = jnp.clip(light, 0.0, 1.0)
    return jnp.where(light <= 0.0031308, 12.92 * light, 1.055 * jnp.maximum(light, 1e-6) ** (1 / 2.4) - 0.055)
