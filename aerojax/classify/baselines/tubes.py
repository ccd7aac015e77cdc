"""Tubes of a clip: points about anchors of every second frame, in that frame and the ones before and behind it.

Anchors are farthest points of frames 0, 2, 4, …; a tube holds the points of a ball about its anchor in three frames.
Before the first frame it stands again (Fan et al. 2021, P4Transformer, with its released kernel of 3, stride of 2 and
padding of one frame in front).
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from aerojax.classify.baselines.clouds import in_ball
from aerojax.classify.baselines.config import TubeSizes
from aerojax.core.types import pytree_dataclass
from kernels.sampling.farthest_points_reference import farthest_points

NEAR_ZERO = 1e-3
"""Points whose squared norm is no more are no anchors while there are others, as in the released sampling."""
OFFSETS = (-1, 0, 1)
"""Frames of a tube, relative to its anchor's."""


@pytree_dataclass
class Tubes:
    """The tubes of a clip.

    anchors: of every second frame, in the order of their choice.
    points: of each anchor's ball in each of the three frames.
    """

    anchors: Float[Array, "anchor_frame tube 3"]
    points: Float[Array, "anchor_frame offset tube near 3"]


def anchor_frames(frames: int) -> int:
    """How many frames of a clip have anchors."""
    return max(1, frames // 2)


def valid_anchor_frames(count: Int[Array, "*batch"], frames: int) -> Bool[Array, "*batch anchor_frame"]:
    """Which anchor frames a clip has of which the first `count` of `frames` frames are there."""
    return jnp.arange(anchor_frames(frames)) < jnp.maximum(count[..., None] // 2, 1)


def tubes(points: Float[Array, "time token 3"], count: Int[Array, ""], sizes: TubeSizes) -> Tubes:
    """Cut a clip into tubes.

    Args:
        points: of `count` frames and then of any others. A single frame is a clip of three equal ones.
        count: frames that are there, at least 1. Anchor frames beyond `valid_anchor_frames` hold nothing of meaning.
        sizes: radius, points of a ball, points for each anchor; a frame has at least one anchor.
    """
    points = jax.lax.stop_gradient(points)
    frames = anchor_frames(points.shape[0])
    centre = jnp.arange(frames) * 2
    index = centre[:, None] + jnp.asarray(OFFSETS)[None]
    around = points[jnp.clip(index, 0, jnp.maximum(count - 1, 0))]
    number = max(1, points.shape[1] // sizes.stride)

    def anchored(frame: Array) -> Array:
        return frame[farthest_points(frame, number, min_square_norm=NEAR_ZERO)]

    def gathered(frame: Array, anchors: Array) -> Array:
        return frame[in_ball(frame, anchors, sizes.radius, sizes.neighbours)]

    anchors = jax.vmap(anchored)(around[:, 1])
    inside = jax.vmap(jax.vmap(gathered, in_axes=(0, None)))(around, anchors)
    return Tubes(anchors, inside)


def with_time(anchors: Float[Array, "anchor_frame tube 3"]) -> Float[Array, "anchor_frame tube 4"]:
    """Anchors beside the number of their anchor frame, from 1."""
    number = jnp.arange(1, anchors.shape[0] + 1).astype(anchors.dtype)
    return jnp.concatenate([anchors, jnp.broadcast_to(number[:, None, None], (*anchors.shape[:2], 1))], axis=-1)
