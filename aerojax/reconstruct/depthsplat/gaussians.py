"""The Gaussian head and what its numbers mean: one bounded Gaussian a pixel, in the frame of the cameras."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from flax import nnx
from jaxtyping import Array, Float

from aerojax.core.types import SH_C0, Camera, Gaussians, View
from aerojax.geometry.cameras import unproject_depth
from aerojax.geometry.rotations import normalise, quaternion_from_rotation, quaternion_multiply
from aerojax.reconstruct.depthsplat.config import DepthSplatSizes
from aerojax.reconstruct.depthsplat.draws import Draws
from aerojax.reconstruct.depthsplat.layers import Convolution, gelu

OPACITY, OFFSET, SCALE, QUATERNION, COLOUR = 0, 1, 3, 6, 10
"""First channels of the head: opacity, offset in the pixel (2), scale (3), quaternion x y z w (4), coefficients."""


class GaussianHead(nnx.Module):
    """Image, depth, certainty and features of every pixel → attributes of its Gaussian.

    Scales and colours start at zero, that is in the middle of their bounds and as in the image.
    """

    def __init__(self, config: DepthSplatSizes, *, draws: Draws):
        width, head, outputs = config.feature_width, config.head_width, COLOUR + 3 * (config.sh_degree + 1) ** 2
        self.regress = nnx.List([Convolution(5 + width, head, draws=draws), Convolution(head, head, draws=draws)])
        self.first = Convolution(4 + width + head, outputs, draws=draws, edge="nearest")
        self.last = Convolution(outputs, outputs, draws=draws, edge="nearest")
        assert self.last.bias is not None
        for rows in (slice(SCALE, QUATERNION), slice(COLOUR, None)):
            self.last.weight[...] = self.last.weight[...].at[rows].set(0.0)
            self.last.bias[...] = self.last.bias[...].at[rows].set(0.0)

    def __call__(
        self,
        image: Float[Array, "view height width 3"],
        depth: Float[Array, "view height width 1"],
        certainty: Float[Array, "view height width 1"],
        features: Float[Array, "view height width channel"],
    ) -> Float[Array, "view height width attribute"]:
        """Attributes before any bound."""
        hidden = self.hidden(image, depth, certainty, features)
        x = jnp.concatenate([hidden, image, features, certainty], axis=-1)
        return self.last(gelu(self.first(x)))

    def hidden(
        self,
        image: Float[Array, "view height width 3"],
        depth: Float[Array, "view height width 1"],
        certainty: Float[Array, "view height width 1"],
        features: Float[Array, "view height width channel"],
    ) -> Float[Array, "view height width head"]:
        """Features that know the depth."""
        x = jnp.concatenate([image, depth, certainty, features], axis=-1)
        return self.regress[1](gelu(self.regress[0](x)))


def bounded_scale(
    raw: Float[Array, "*batch 3"], unit: Float[Array, ""], config: DepthSplatSizes
) -> Float[Array, "*batch 3"]:
    """s = σ_max·sigmoid(x) + σ_min (thesis Eq. 5.1), metres; the bounds grow with the arrangement."""
    return unit * (config.scale_max * jax.nn.sigmoid(raw) + config.scale_min)


def pixel_gaussians(
    raw: Float[Array, "view height width attribute"],
    depth: Float[Array, "view height width"],
    gate: Float[Array, "view height width"],
    views: View,
    unit: Float[Array, ""],
    config: DepthSplatSizes,
) -> Gaussians:
    """Gaussians of all pixels, views one after the other, in the frame of the cameras.

    Args:
        raw: of `GaussianHead`.
        depth: metres along the optical axis.
        gate: what opacities are multiplied by.
        views: their images give the colours, their cameras the places.
        unit: see `DepthRange`.
        config: bounds of the scales.
    """
    attributes = raw.reshape(len(raw), -1, raw.shape[-1])
    mean = jax.vmap(_means)(attributes[..., OFFSET:SCALE], depth, views.camera)
    x, y, z, w = jnp.moveaxis(attributes[..., QUATERNION:COLOUR], -1, 0)
    own = normalise(jnp.stack([w, x, y, z], axis=-1))
    turn = quaternion_from_rotation(views.camera.world_from_cam[:, :3, :3])
    quaternion = quaternion_multiply(jnp.broadcast_to(turn[:, None], own.shape), own)
    opacity = jax.nn.sigmoid(attributes[..., OPACITY]) * gate.reshape(len(raw), -1)
    scale = bounded_scale(attributes[..., SCALE:QUATERNION], unit, config)
    # Coefficients are stored colour by colour; only those of degree 0 are used.
    direct = attributes[..., COLOUR :: (config.sh_degree + 1) ** 2]
    sh = direct + (views.rgb.reshape(len(raw), -1, 3) - 0.5) / SH_C0
    flat = [x.reshape(-1, *x.shape[2:]) for x in (mean, quaternion, scale, opacity, sh[:, :, None])]
    return Gaussians(*flat)


def _means(
    raw: Float[Array, "pixel 2"], depth: Float[Array, "height width"], camera: Camera
) -> Float[Array, "pixel 3"]:
    """Points at the depth of each pixel, up to half a pixel beside its centre."""
    height, width = depth.shape
    rows, columns = jnp.mgrid[:height, :width].astype(depth.dtype)
    corner = jnp.stack([columns.ravel(), rows.ravel()], axis=-1)
    return unproject_depth(corner + jax.nn.sigmoid(raw), depth.ravel(), camera)
