"""LGM behind the door: crops to the canonical cube and its camera rays, the U-Net's numbers to Gaussians in metres."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from aerojax.core.types import SH_C0, Camera, Gaussians, View, pytree_dataclass, static_field
from aerojax.geometry.cameras import pixel_rays
from aerojax.geometry.rotations import normalise
from aerojax.reconstruct.lgm.config import LgmConfig
from aerojax.reconstruct.lgm.unet import LgmNetwork
from aerojax.reconstruct.packing import visible_first

WINDOW = 1.37
"""Width of the canonical cameras' image at the object: 49.1° seen from 1.5 (Tang et al. 2024)."""
LARGEST_SCALE = 0.1
"""Factor of softplus in a standard deviation, in canonical units."""


@pytree_dataclass
class Lgm:
    """The member of the door.

    network: holds every parameter.
    config: of the network.
    """

    network: LgmNetwork
    config: LgmConfig = static_field()

    def __call__(self, views: View, valid: Bool[Array, "view"]) -> tuple[Gaussians, Int[Array, ""]]:
        """See `Reconstructor`: Gaussians that can be seen come first."""
        return visible_first(self._gaussians(views, valid))

    def steps(self, views: View, valid: Bool[Array, "view"]) -> tuple[Gaussians, ...]:
        """See `TrainableReconstructor`: one step, in the order of the pixels."""
        return (self._gaussians(views, valid),)

    def _gaussians(self, views: View, valid: Bool[Array, "view"]) -> Gaussians:
        """One Gaussian for each pixel of half the size of every view; those of views that do not count are clear."""
        metres = _metres(views.camera, valid)
        numbers = self.network(_network_input(views, valid, metres, self.config.size), valid).reshape(-1, 14)
        each = numbers.shape[0] // len(valid)
        opacity = jax.nn.sigmoid(numbers[:, 3]) * jnp.repeat(valid, each).astype(numbers.dtype)
        colour = 0.5 * jnp.tanh(numbers[:, 11:14]) + 0.5
        return Gaussians(
            mean=jnp.clip(numbers[:, 0:3], -1.0, 1.0) * metres,
            quaternion=normalise(numbers[:, 7:11] + jnp.array([[1e-4, 0.0, 0.0, 0.0]])),
            scale=LARGEST_SCALE * jax.nn.softplus(numbers[:, 4:7]) * metres,
            opacity=opacity,
            sh=((colour - 0.5) / SH_C0)[:, None, :],
        )


def _metres(cameras: Camera, valid: Bool[Array, "view"]) -> Float[Array, ""]:
    """Metres of a canonical unit: the mean view's window at the origin is `WINDOW` wide."""
    distance = jnp.linalg.norm(cameras.world_from_cam[:, :3, 3], axis=-1)
    width = distance * cameras.width / cameras.K[:, 0, 0]
    weight = valid.astype(width.dtype)
    mean = jnp.sum(width * weight) / jnp.maximum(jnp.sum(weight), 1.0)
    return jnp.where(mean > 0, mean, 1.0) / WINDOW


def _network_input(
    views: View, valid: Bool[Array, "view"], metres: Float[Array, ""], size: int
) -> Float[Array, "view {size} {size} 9"]:
    """Colour over white, -1..1, and Plücker coordinates o × d, d of each pixel's ray in canonical units."""
    colour = views.rgb * views.mask[..., None] + (1.0 - views.mask[..., None])
    colour = jax.image.resize(colour, (len(valid), size, size, 3), "linear") * 2.0 - 1.0
    factor = size / views.camera.width
    K = views.camera.K * jnp.array([[factor, 1.0, factor], [1.0, factor, factor], [1.0, 1.0, 1.0]])[None]
    at = jnp.arange(size, dtype=jnp.float32) + 0.5
    pixels = jnp.stack(jnp.meshgrid(at, at, indexing="xy"), axis=-1)

    def rays(K: Float[Array, "3 3"], pose: Float[Array, "4 4"]) -> Float[Array, "row column 6"]:
        direction = pixel_rays(pixels, Camera(K, pose, size, size))
        origin = jnp.broadcast_to(pose[:3, 3] / metres, direction.shape)
        return jnp.concatenate([jnp.cross(origin, direction), direction], axis=-1)

    images = jnp.concatenate([colour, jax.vmap(rays)(K, views.camera.world_from_cam)], axis=-1)
    return jnp.where(valid[:, None, None, None], images, 0.0)
