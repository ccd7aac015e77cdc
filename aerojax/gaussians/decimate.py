"""From the thousands of Gaussians of a reconstruction to the tokens of the classifier."""

from __future__ import annotations

from dataclasses import dataclass

import jax
import jax.numpy as jnp
from jaxtyping import Array, Int, Key

from aerojax.types import Gaussians
from kernels.farthest_points import farthest_points


@dataclass(frozen=True)
class DecimationConfig:
    """Sizes of the chain: `draw` with replacement, `farthest` of them by farthest points, `keep` of those at random."""

    draw: int = 8192
    farthest: int = 1200
    keep: int = 1024


def decimate(
    gaussians: Gaussians, *, key: Key[Array, ""], config: DecimationConfig, count: Int[Array, ""] | int | None = None
) -> Gaussians:
    """Random 8192 → farthest-point 1200 → random 1024 (thesis §5.6.2; sizes by `config`).

    The choice depends on distances only, hence not on the world's orientation except through rounding: call it in a
    frame fixed to the rig where bit-equal choices matter.

    Args:
        gaussians: any number of them; fewer than `keep` repeat.
        key: the same key and Gaussians give the same choice.
        config: sizes.
        count: how many of the leading Gaussians are real; all if None. At least 1.
    """
    draw, last = jax.random.split(key)
    total = gaussians.mean.shape[0] if count is None else count
    drawn = jax.random.randint(draw, (config.draw,), 0, total)
    far = farthest_points(gaussians.mean[drawn], config.farthest)
    kept = jax.random.permutation(last, config.farthest)[: config.keep]
    index = drawn[far[kept]]
    return jax.tree.map(lambda leaf: leaf[index], gaussians)
