"""What each view shows where a Gaussian projects: features of images, the error's gradient, how the view stands."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from flax import nnx
from jaxtyping import Array, Bool, Float

from aerojax.core.types import Camera, View, pytree_dataclass
from aerojax.geometry.cameras import pixels_of_camera_points, points_in_camera
from aerojax.geometry.rotations import rotation_from_quaternion
from aerojax.reconstruct.refine.feedback import CHANGES, MAPS, Feedback
from aerojax.reconstruct.refine.parameters import Parameters
from aerojax.reconstruct.silhouette import bilinear, known_at

PLACE = 20
"""Numbers of how a view stands to a Gaussian."""
ERROR = slice(4, 7)
"""Of a sample: the error of the colour."""


@pytree_dataclass
class Lengths:
    """What lengths are measured by at each Gaussian, metres.

    pixel: of the finest view. spacing: to the neighbours.
    """

    pixel: Float[Array, "gaussian"]
    spacing: Float[Array, "gaussian"]


class Pyramid(nnx.Module):
    """Six 3×3 convolutions: image features at the image's size, a half and a quarter."""

    def __init__(self, channels: tuple[int, int, int], *, rngs: nnx.Rngs):
        first, second, third = channels
        self.layers = nnx.List(
            [
                nnx.Conv(inputs, outputs, (3, 3), strides=stride, rngs=rngs)
                for inputs, outputs, stride in (
                    (MAPS, first, 1),
                    (first, first, 1),
                    (first, second, 2),
                    (second, second, 1),
                    (second, third, 2),
                    (third, third, 1),
                )
            ]
        )

    def __call__(self, images: Float[Array, "view size size 9"]) -> tuple[Float[Array, "view _ _ _"], ...]:
        """Features of every second layer."""
        levels = []
        for index, layer in enumerate(self.layers):
            images = nnx.gelu(layer(images))
            if index % 2:
                levels.append(images)
        return tuple(levels)


def seen_by(points: Float[Array, "gaussian 3"], views: View, valid: Bool[Array, "view"]) -> Bool[Array, "view _"]:
    """Which views count, one column for all points, or a column for each where views do not show all of them."""
    if views.known is None:
        return valid[:, None]

    def one(view: View) -> Bool[Array, "gaussian"]:
        assert view.known is not None
        return known_at(view.known, _pixels(points, view.camera)[0])

    return valid[:, None] & jax.vmap(one)(views)


def _pixels(
    points: Float[Array, "gaussian 3"], camera: Camera
) -> tuple[Float[Array, "gaussian 2"], Float[Array, "gaussian 1"]]:
    """Pixels and depths; depth is kept positive."""
    inside = points_in_camera(points, camera)
    depth = jnp.maximum(inside[:, 2:], 1e-3)
    return pixels_of_camera_points(jnp.concatenate([inside[:, :2], depth], axis=-1), camera), depth


def sampled(
    now: Parameters, lengths: Lengths, seen: Feedback, levels: tuple[Array, ...], views: View
) -> Float[Array, "view gaussian feature"]:
    """What every view says of every Gaussian; only the features of `levels` are differentiated."""
    fixed = jax.lax.stop_gradient(now)
    return jax.vmap(lambda *view: _of_view(fixed, lengths, *view))(seen, levels, views)


def _of_view(
    now: Parameters, lengths: Lengths, seen: Feedback, levels: tuple[Array, ...], view: View
) -> Float[Array, "gaussian feature"]:
    pixels, depth = _pixels(now.mean, view.camera)
    maps = bilinear(seen.images, pixels)
    behind = (depth[:, 0] - bilinear(seen.depth, pixels)) / jnp.maximum(lengths.spacing, lengths.pixel)
    own_axes = view.camera.world_from_cam[:3, :3].T @ rotation_from_quaternion(now.quaternion)
    span = depth / view.camera.K[0, 0]
    shown = (pixels > 0) & (pixels < view.camera.width)
    shown = shown if view.known is None else shown & known_at(view.known, pixels)[:, None]
    place = [
        own_axes[:, :, 2],  # the normal: its sign means something, those of the other axes do not
        jnp.abs(own_axes).reshape(-1, 9),
        now.log_scale - jnp.log(span),
        jnp.clip(behind, -4.0, 4.0)[:, None] / 2.0,
        jnp.all(shown, axis=-1, keepdims=True).astype(depth.dtype),
        now.colour - maps[:, 0:3],
    ]
    gradient = jnp.concatenate([seen.gradient[:, :3] * span, seen.gradient[:, 3:]], axis=-1)
    features = [bilinear(level, pixels / 2**halvings) for halvings, level in enumerate(levels)]
    return jnp.concatenate([maps, _compressed(gradient), *place, *features], axis=-1)


def _compressed(gradient: Float[Array, "gaussian 13"]) -> Float[Array, "gaussian 13"]:
    """Sign kept, magnitudes of several orders brought to some units."""
    return jnp.sign(gradient) * jnp.log1p(10.0 * jnp.abs(gradient)) / 2.0


def sample_width(channels: tuple[int, int, int]) -> int:
    """Features of one view and Gaussian."""
    return MAPS + CHANGES + PLACE + sum(channels)
