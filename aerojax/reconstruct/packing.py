"""Gaussians that can be seen in front of those that cannot, as the door of stage 2 asks."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jaxtyping import Array, Int

from aerojax.core.types import Gaussians

LEAST_OPACITY = 1 / 255
"""What is fainter no splat draws (Kerbl et al. 2023)."""


def visible_first(gaussians: Gaussians) -> tuple[Gaussians, Int[Array, ""]]:
    """As many Gaussians, those that can be seen first and in order, then the first one again and again; their count."""
    seen = gaussians.opacity > LEAST_OPACITY
    count = jnp.sum(seen)
    order = jnp.argsort(~seen, stable=True)
    index = jnp.where(jnp.arange(len(order)) < count, order, order[0])
    return jax.tree.map(lambda leaf: leaf[index], gaussians), count
