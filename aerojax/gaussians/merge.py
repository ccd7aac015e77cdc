"""Many Gaussians merged into few by their moments: clusters keep mass, mean, covariance, opacity and colour.

A cluster's Gaussian has the first two moments of the mixture of its members (Runnalls 2007, "Kullback-Leibler approach
to Gaussian mixture reduction", Eq. 2-4), so the covariances carry the parts that random draws would miss.
"""

from __future__ import annotations

from typing import Literal

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from aerojax.core.types import pytree_dataclass
from aerojax.geometry.covariances import axes_from_covariance, covariance_from_axes

Seeds = Literal["first", "farthest"]
"""Where clusters begin: at the first tokens as they lie, or at farthest points from the token farthest out."""

SOFTNESS = 0.2
"""Width of the soft assignment as a share of the tokens' mean squared distance from their clusters: between two
clusters a token's weights change by 1e-5 where rounding moves it by 1e-7 of the object, instead of by 1."""
_FAR = 1e30


@pytree_dataclass
class MergedGaussians:
    """Clusters of Gaussians as moments; all zero where `mask` is False.

    mean, covariance: in the unit of the tokens and its square.
    opacity, colour: means of the members', weighted by opacity.
    share: of the tokens' whole opacity; sums to 1.
    mask: clusters that have members.
    """

    mean: Float[Array, "*time count 3"]
    covariance: Float[Array, "*time count 3 3"]
    opacity: Float[Array, "*time count"]
    colour: Float[Array, "*time count 3"]
    share: Float[Array, "*time count"]
    mask: Bool[Array, "*time count"]


def merge_gaussians(
    columns: Float[Array, "token 14"],
    mask: Bool[Array, "token"],
    count: int,
    *,
    lloyd: int = 2,
    seeds: Seeds = "farthest",
) -> tuple[Float[Array, "count 14"], Bool[Array, "count"]]:
    """The columns of `merge_moments`, with axes in the order of descending scales; rows off the mask are zero."""
    merged = merge_moments(columns, mask, count, lloyd=lloyd, seeds=seeds)
    quaternion, scale = axes_from_covariance(merged.covariance)
    parts = (merged.mean, quaternion, scale, merged.opacity[:, None], merged.colour)
    return jnp.where(merged.mask[:, None], jnp.concatenate(parts, axis=1), 0.0), merged.mask


def merge_moments(
    columns: Float[Array, "token 14"],
    mask: Bool[Array, "token"],
    count: int,
    *,
    lloyd: int = 2,
    seeds: Seeds = "farthest",
    origin: Float[Array, "2 3"] | None = None,
) -> MergedGaussians:
    """Cluster the tokens of one frame and match each cluster's moments; turns and moves with the tokens.

    Tokens belong to clusters by the softmax of -d²/width and `lloyd` times the clusters move to their means. So all but
    the choice of seeds is continuous, and rounding cannot move a token from one cluster to another. The seeds "first"
    are no choice of geometry; "farthest" does not depend on the tokens' order and leaves no part without a seed, but
    where two tokens are equally far within rounding, another one may be taken.

    Args:
        columns: tokens; rows off the mask may hold any finite numbers.
        mask: valid tokens; no more of them than `count` are returned as they are.
        count: of clusters.
        lloyd: how often seeds move to the means of their tokens.
        seeds: where clusters begin.
        origin: from which the means are counted, as a sum of two parts, the second of which may be small; that of the
            tokens if None. It is taken from the clusters and not from the tokens, whose places it would round.
    """
    columns = jnp.where(mask[:, None], columns, 0.0)
    valid = mask.astype(columns.dtype)
    centre = valid @ columns[:, :3] / jnp.maximum(valid.sum(), 1.0)
    position = jnp.where(mask[:, None], columns[:, :3] - centre[None], 0.0)
    chosen, real = _seeds(position, mask, count, seeds)
    seed, weights = columns[chosen, :3], valid * jnp.maximum(columns[:, 10], 1e-6)
    # A cluster's place is its seed's and how far it has moved from there: that is short, and differences of tokens keep
    # all their digits, where one number would be rounded by much of the small distances within a cluster.
    moved = jnp.zeros_like(seed)
    for _ in range(lloyd):
        offset = columns[:, None, :3] - seed[None] - moved[None]
        belonging = _belonging(position, offset, valid, real) * weights[:, None]
        moved = moved + jnp.sum(belonging[..., None] * offset, axis=0) / _mass(belonging)[:, None]
    offset = columns[:, None, :3] - seed[None] - moved[None]
    belonging = _belonging(position, offset, valid, real) * weights[:, None]
    if origin is not None:
        seed = seed - origin[:1] - origin[1:]
    return _moments(columns, (seed, moved), offset, belonging, real)


def _seeds(
    position: Float[Array, "token 3"], mask: Bool[Array, "token"], count: int, seeds: Seeds
) -> tuple[Int[Array, "count"], Bool[Array, "count"]]:
    """Index of each seed, and which seeds are real: no more than there are valid tokens."""
    real = jnp.arange(count) < mask.sum()
    if seeds == "first":
        order = jnp.argsort(~mask, stable=True)
        return jnp.pad(order[:count], (0, max(0, count - len(order)))), real
    outside = jnp.where(mask, jnp.sum(position**2, axis=-1), -1.0)
    first = jnp.argmax(outside)

    def choose(near: Array, last: Array) -> Array:
        square = jnp.sum((position - position[last][None]) ** 2, axis=-1)
        # A chosen token is out for good, so that its duplicates come before it comes twice.
        return jnp.minimum(near, square).at[last].set(-1.0)

    def follow(near: Array, _: None) -> tuple[Array, Array]:
        following = jnp.argmax(near)
        return choose(near, following), following

    near = choose(jnp.where(mask, _FAR, -1.0).astype(position.dtype), first)
    rest = jax.lax.scan(follow, near, None, length=count - 1)[1]
    return jnp.concatenate([first[None], rest]), real


def _belonging(
    position: Float[Array, "token 3"],
    offset: Float[Array, "token count 3"],
    valid: Float[Array, "token"],
    real: Bool[Array, "count"],
) -> Float[Array, "token count"]:
    """How far each token belongs to each cluster; rows sum to 1."""
    square = jnp.where(real[None], jnp.sum(offset**2, axis=-1), _FAR)
    nearest = square.min(axis=1)
    total = jnp.maximum(valid.sum(), 1.0)
    size = jnp.sum(valid[:, None] * position**2) / total
    width = SOFTNESS * jnp.sum(jnp.where(valid > 0, nearest, 0.0)) / total + 1e-12 * size + 1e-30
    belonging = jnp.exp((nearest[:, None] - square) / width)
    return belonging / belonging.sum(axis=1, keepdims=True)


def _mass(belonging: Float[Array, "token count"]) -> Float[Array, "count"]:
    return jnp.maximum(belonging.sum(axis=0), 1e-12)


def _moments(
    columns: Float[Array, "token 14"],
    place: tuple[Float[Array, "count 3"], Float[Array, "count 3"]],
    offset: Float[Array, "token count 3"],
    belonging: Float[Array, "token count"],
    real: Bool[Array, "count"],
) -> MergedGaussians:
    """Moments of the clusters, each token weighted by how far it belongs to them.

    Args:
        columns: tokens.
        place: of each cluster: its seed's, and how far it has moved.
        offset: from there to each token.
        belonging: how far each token belongs to each cluster.
        real: clusters that may have members.
    """
    mass = _mass(belonging)
    parts = belonging / mass[None]
    further = jnp.sum(parts[..., None] * offset, axis=0)
    own = covariance_from_axes(columns[:, 3:7], columns[:, 7:10])
    offset = offset - further[None]
    spread = jnp.einsum("tka,tkb->kab", offset * parts[..., None], offset)
    covariance = jnp.einsum("tk,tab->kab", parts, own) + spread
    mask = real & (belonging.sum(axis=0) > 0)
    found = MergedGaussians(
        mean=place[0] + (place[1] + further),
        covariance=(covariance + covariance.swapaxes(-1, -2)) / 2,
        opacity=parts.T @ columns[:, 10],
        colour=parts.T @ columns[:, 11:14],
        share=belonging.sum(axis=0) / jnp.maximum(belonging.sum(), 1e-12),
        mask=mask,
    )

    def blank(leaf: Array) -> Array:
        return jnp.where(mask.reshape(-1, *[1] * (leaf.ndim - 1)), leaf, jnp.zeros((), leaf.dtype))

    return jax.tree.map(blank, found)
