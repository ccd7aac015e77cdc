"""Where rays meet: linear triangulation from unit rays."""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Array, Float


def intersect_rays(
    origins: Float[Array, "ray 3"], directions: Float[Array, "ray 3"], weights: Float[Array, "ray"] | None = None
) -> Float[Array, "3"]:
    """The point nearest to all rays in the least-squares sense.

    X₀ = (Σ wᵢ(I - dᵢdᵢᵀ))⁻¹ Σ wᵢ(I - dᵢdᵢᵀ) oᵢ (Hartley & Sturm 1997, mid-point form for n rays).

    Args:
        origins: camera centres, metres, any one frame.
        directions: unit rays in that frame.
        weights: non-negative; zero removes a ray. At least two non-parallel rays must remain.

    Returns:
        The point in the same frame; huge or not finite where all rays are parallel.
    """
    weights = jnp.ones(origins.shape[0], origins.dtype) if weights is None else weights
    # About the mean origin: the normal equations stay well scaled far from the frame's zero.
    anchor = jnp.sum(origins * weights[:, None], axis=0) / jnp.maximum(jnp.sum(weights), 1e-12)
    projectors = jnp.eye(3, dtype=origins.dtype)[None] - directions[:, :, None] * directions[:, None, :]
    projectors = projectors * weights[:, None, None]
    right = jnp.einsum("rij,rj->i", projectors, origins - anchor[None])
    return jnp.linalg.solve(projectors.sum(axis=0), right) + anchor
