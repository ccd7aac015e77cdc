"""A small refined hull with parameters that do something, and the views it sees."""

from __future__ import annotations

from dataclasses import replace

import jax
import jax.numpy as jnp

from aerojax.core.types import View
from aerojax.reconstruct.refine.config import RefineConfig
from aerojax.reconstruct.refine.reconstructor import Refine
from tests.support.hull_views import pixel_centres, rig, sphere_mask, views_of

SMALL = RefineConfig(
    grid=24, capacity=160, dilation=0.35, image=32, updates=2, neighbours=4, width=8, channels=(4, 4, 4)
)


def busy(config: RefineConfig = SMALL, *, scale: float = 0.5) -> Refine:
    """A member whose last layers are not zero: every change is asked for."""
    member = config.untrained(key=jax.random.key(0))
    leaves, structure = jax.tree.flatten(member)
    keys = jax.random.split(jax.random.key(1), len(leaves))
    drawn = [leaf + scale * jax.random.normal(k, leaf.shape) / 4.0 for leaf, k in zip(leaves, keys, strict=True)]
    return jax.tree.unflatten(structure, drawn)


def sphere_views(count: int = 5, *, radius: float = 0.45) -> View:
    """A ball off the middle, of which every view sees another pattern."""
    views = views_of(rig(count), lambda camera: sphere_mask(camera, radius, centre=(0.05, -0.03, 0.04)))
    across, down = pixel_centres()[..., 0] / 96.0, pixel_centres()[..., 1] / 96.0
    phase = jnp.arange(count, dtype=jnp.float32)[:, None, None]
    pattern = 0.5 + 0.5 * jnp.sin(9.0 * across[None] + phase) * jnp.cos(7.0 * down[None] - phase)
    return replace(views, rgb=jnp.stack([pattern, 1.0 - pattern, 0.5 * views.mask], axis=-1))
