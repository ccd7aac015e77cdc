"""DepthSplat-OC behind the door of stage 2."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Int, Key

from aerojax.core.types import Gaussians, View, pytree_dataclass, static_field
from aerojax.reconstruct.depthsplat.config import DepthSplatSizes
from aerojax.reconstruct.depthsplat.draws import drawn
from aerojax.reconstruct.depthsplat.network import DepthSplatNetwork, Prediction, resized_views

LEAST_OPACITY = 1 / 255
"""What is fainter is not drawn at all."""


@pytree_dataclass
class DepthSplat:
    """The member of the door: Gaussians of the pixels that show the object."""

    network: DepthSplatNetwork
    config: DepthSplatSizes = static_field()

    def __call__(self, views: View, valid: Bool[Array, "view"]) -> tuple[Gaussians, Int[Array, ""]]:
        """See `Reconstructor`; views of any size are resampled to `config.size`."""
        return strongest(self.predict(views, valid).gaussians, self.config.capacity)

    def steps(self, views: View, valid: Bool[Array, "view"]) -> tuple[Gaussians, ...]:
        """See `TrainableReconstructor`: there is one."""
        gaussians, count = self(views, valid)
        fills = jnp.arange(len(gaussians.opacity)) >= count
        return (dataclasses.replace(gaussians, opacity=jnp.where(fills, 0.0, gaussians.opacity)),)

    def predict(self, views: View, valid: Bool[Array, "view"]) -> Prediction:
        """Depth and a Gaussian for every pixel of the resampled views, differentiable."""
        return self.network(resized_views(views, self.config.size), valid)


def strongest(gaussians: Gaussians, capacity: int) -> tuple[Gaussians, Int[Array, ""]]:
    """The Gaussians that can be seen, and how many; more than `capacity` are thinned evenly, fewer repeat the first."""
    shown = gaussians.opacity > LEAST_OPACITY
    number = len(gaussians.opacity)
    capacity = min(capacity, number)
    everything = jnp.nonzero(shown, size=number, fill_value=0)[0]
    total = jnp.sum(shown)
    count = jnp.minimum(total, capacity)
    rank = jnp.arange(capacity)
    stride = jnp.maximum(total / capacity, 1.0)
    index = everything[jnp.where(rank < count, (rank.astype(stride.dtype) * stride).astype(jnp.int32), 0)]
    return jax.tree.map(lambda leaf: leaf[index], gaussians), count


def untrained_depthsplat(config: DepthSplatSizes, *, key: Key[Array, ""]) -> DepthSplat:
    """The member with random weights."""
    return DepthSplat(drawn(lambda draws: DepthSplatNetwork(config, draws=draws), key=key), config)
