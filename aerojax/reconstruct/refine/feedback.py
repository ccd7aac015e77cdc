"""What is wrong with Gaussians: their renderings beside the input views, and which change would mend it.

Beside the images, the gradient of each view's error is fed back (as G3R does, Chen et al. 2024): it says for every
Gaussian, with occlusion and blending taken into account, what sampling the error where its centre projects cannot.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from aerojax.core.types import Camera, Gaussians, View, pytree_dataclass
from aerojax.gaussians.render import Rendering, expected_depth, render
from aerojax.reconstruct.refine.parameters import turned

MAPS = 9
"""Channels of `Feedback.images`."""
CHANGES = 13
"""Entries of `Feedback.gradient`."""


@pytree_dataclass
class Feedback:
    """All zero for views that do not count, the images also where nothing is known.

    images: the object's colour 0:3 and coverage 3, errors of colour 4:7 and coverage 7, alpha 8.
    depth: of what is rendered, metres.
    gradient: of each view's error with respect to the Gaussians: along the camera's axes (per metre) 0:3, turns about
        their own axes 3:6, logarithms of the scales 6:9, opacity 9, colour coefficients 10:13.
    """

    images: Float[Array, "view size size 9"]
    depth: Float[Array, "view size size"]
    gradient: Float[Array, "view gaussian 13"]


def resized(views: View, size: int) -> View:
    """Crops of another side, averaged over equal areas where it divides theirs."""
    side = views.camera.width
    if side == size:
        return views
    factor = jnp.array([[size / side, 1.0, size / side], [1.0, size / side, size / side], [1.0, 1.0, 1.0]])
    camera = Camera(views.camera.K * factor[None], views.camera.world_from_cam, size, size)
    known = views.known
    if known is not None:
        # What is averaged over pixels that are not known is not known.
        known = _resampled(known[..., None].astype(views.mask.dtype), size)[..., 0] > 0.999
    return View(_resampled(views.rgb, size), _resampled(views.mask[..., None], size)[..., 0], camera, known)


def _resampled(images: Float[Array, "view side side channel"], size: int) -> Float[Array, "view size size channel"]:
    views, side, _, channels = images.shape
    if side % size == 0:
        step = side // size
        return images.reshape(views, size, step, size, step, channels).mean(axis=(2, 4))
    return jax.image.resize(images, (views, size, size, channels), "linear")


def feedback(gaussians: Gaussians, views: View, valid: Bool[Array, "view"]) -> Feedback:
    """Render Gaussians into all views and compare; nothing of it is differentiated further.

    The error is ½ Σ |C - A·rgb|² over the object's coverage + ½ Σ (A - mask)²: the background, of which nothing is
    known, takes no part, nor does what lies beyond the border of an image.

    Args:
        gaussians: in the cameras' frame.
        views: input crops.
        valid: views that count.
    """
    unchanged = jnp.zeros((len(valid), len(gaussians.mean), CHANGES), gaussians.mean.dtype)
    gradient, (seen, colour, alpha) = jax.grad(_error, has_aux=True)(unchanged, gaussians, views)
    use = valid.astype(gradient.dtype)[:, None, None]
    shown = (views.rgb * views.mask[..., None], views.mask[..., None])
    images = jnp.concatenate([*shown, colour, alpha[..., None], seen.alpha[..., None]], axis=-1)
    shares = use[..., None] if views.known is None else use[..., None] * views.known[..., None].astype(use.dtype)
    found = Feedback(_counted(images, shares), expected_depth(seen) * use, _counted(gradient, use))
    return jax.lax.stop_gradient(found)


def _counted(values: Array, use: Array) -> Array:
    """Values of views that count, 0 elsewhere whatever stood there."""
    return jnp.where(use > 0, values, 0.0)


def _error(
    change: Float[Array, "view gaussian 13"], gaussians: Gaussians, views: View
) -> tuple[Float[Array, ""], tuple[Rendering, Array, Array]]:
    """Sum of all views' errors of Gaussians that each view changes for itself, and its parts."""
    axes = views.camera.world_from_cam[:, :3, :3]
    quaternion = jnp.broadcast_to(gaussians.quaternion[None], (*change.shape[:2], 4))
    changed = Gaussians(
        gaussians.mean[None] + jnp.einsum("vij,vgj->vgi", axes, change[..., 0:3]),
        turned(quaternion, change[..., 3:6]),
        gaussians.scale[None] * jnp.exp(change[..., 6:9]),
        gaussians.opacity[None] + change[..., 9],
        gaussians.sh[None] + change[..., None, 10:13],
    )
    seen = render(changed, views.camera, background=jnp.zeros(3), antialias=True)
    colour = (seen.colour - seen.alpha[..., None] * views.rgb) * views.mask[..., None]
    alpha = seen.alpha - views.mask
    if views.known is not None:
        colour, alpha = jnp.where(views.known[..., None], colour, 0.0), jnp.where(views.known, alpha, 0.0)
    return 0.5 * (jnp.sum(colour**2) + jnp.sum(alpha**2)), (seen, colour, alpha)
