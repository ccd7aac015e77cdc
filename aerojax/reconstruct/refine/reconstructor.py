"""Render-and-update steps on the hull's Gaussians: the member behind the door."""

from __future__ import annotations

from dataclasses import replace

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Int

from aerojax.core.types import Gaussians, View, pytree_dataclass, static_field
from aerojax.reconstruct.hull import visual_hull
from aerojax.reconstruct.refine.config import RefineConfig
from aerojax.reconstruct.refine.feedback import feedback, resized
from aerojax.reconstruct.refine.neighbours import finest_pixel, nearest, spacing
from aerojax.reconstruct.refine.network import RefineNetwork
from aerojax.reconstruct.refine.parameters import Parameters, gaussians_of, parameters_of, updated
from aerojax.reconstruct.refine.sampling import Lengths, seen_by


@pytree_dataclass
class Refine:
    """A `TrainableReconstructor` of `aerojax.reconstruct.base`.

    network: holds every parameter; the same for all updates.
    config: of the network, the hull and the updates.
    """

    network: RefineNetwork
    config: RefineConfig = static_field()

    def __call__(self, views: View, valid: Bool[Array, "view"]) -> tuple[Gaussians, Int[Array, ""]]:
        """See `Reconstructor`; count and order are the hull's."""
        steps, count = self._steps(views, valid)
        order = jnp.arange(self.config.capacity)
        index = jnp.where(order < count, order, 0)
        return jax.tree.map(lambda leaf: leaf[index], steps[-1]), count

    def steps(self, views: View, valid: Bool[Array, "view"]) -> tuple[Gaussians, ...]:
        """See `TrainableReconstructor`: the hull, then the Gaussians after each update."""
        return self._steps(views, valid)[0]

    def _steps(self, views: View, valid: Bool[Array, "view"]) -> tuple[tuple[Gaussians, ...], Int[Array, ""]]:
        # The hull's outlines run where its masks are one half.
        outlined = replace(views, mask=jnp.minimum(views.mask * (0.5 / self.config.coverage), 1.0))
        valid = showing(outlined, valid)
        some = jnp.any(valid)
        # Without any view the hull's cells have no size: all views then stand in, and nothing is real.
        start, count, _ = visual_hull(outlined, valid | ~some, config=self.config.hull)
        count = jnp.where(some, count, 0)
        real = jnp.arange(self.config.capacity) < count
        return refined(self.network, start, real, resized(views, self.config.image), valid, self.config), count


def showing(views: View, valid: Bool[Array, "view"]) -> Bool[Array, "view"]:
    """Views that count and have a silhouette: an empty mask is a failure to segment and says nothing of the object."""
    shown = views.mask > 0.5 if views.known is None else (views.mask > 0.5) & views.known
    return valid & jnp.any(shown, axis=(1, 2))


def refined(
    network: RefineNetwork,
    start: Gaussians,
    real: Bool[Array, "gaussian"],
    views: View,
    valid: Bool[Array, "view"],
    config: RefineConfig,
) -> tuple[Gaussians, ...]:
    """Gaussians before and after every update; turning `start` and the cameras turns them all.

    Args:
        network: of one update.
        start: in the cameras' frame, near its origin.
        real: Gaussians that count; the others stay transparent.
        views: crops of the size that the network reads.
        valid: views that count.
        config: number of updates, neighbours and bounds.
    """
    start = jax.lax.stop_gradient(_only(start, real))
    near = nearest(start.mean, real, config.neighbours)
    shown = seen_by(start.mean, views, valid)
    lengths = Lengths(finest_pixel(start.mean, views.camera, shown), spacing(start.mean, near))

    def step(state: tuple[Parameters, Array], _: None) -> tuple[tuple[Parameters, Array], Gaussians]:
        now, memory = state
        seen = feedback(jax.lax.stop_gradient(_only(gaussians_of(now), real)), views, valid)
        change, memory = network(now, memory, seen, views, valid, near, lengths)
        now = updated(now, change, lengths.pixel, config.bounds)
        return (now, memory), _only(gaussians_of(now), real)

    begin = parameters_of(start), network.initial(len(real))
    after = jax.lax.scan(step, begin, None, length=config.updates, unroll=True)[1]
    return start, *(jax.tree.map(lambda leaf, i=i: leaf[i], after) for i in range(config.updates))


def _only(gaussians: Gaussians, real: Bool[Array, "gaussian"]) -> Gaussians:
    return replace(gaussians, opacity=jnp.where(real, gaussians.opacity, 0.0))
