"""From the thousands of Gaussians of a reconstruction to the tokens of the classifier."""

from __future__ import annotations

from dataclasses import dataclass

import jax
import jax.numpy as jnp
from jaxtyping import Array, Int, Key

from aerojax.core.config import require_at_least
from aerojax.core.types import Gaussians
from kernels.sampling.farthest_points import farthest_points


@dataclass(frozen=True)
class DecimationConfig:
    """Sizes of the chain.

    draw: Gaussians drawn at random. farthest: of them, chosen by farthest points. keep: of those, drawn at random.
    """

    draw: int = 8192
    farthest: int = 1200
    keep: int = 1024

    def __post_init__(self) -> None:
        """Refuse what keeps nothing."""
        require_at_least(self, "draw", "farthest", "keep")


def decimate(
    gaussians: Gaussians, *, key: Key[Array, ""], config: DecimationConfig, count: Int[Array, ""] | int | None = None
) -> Gaussians:
    """Random 8192 → farthest-point 1200 → random 1024 (thesis §5.6.2; sizes by `config`).

    No more than `draw` Gaussians need no draw. Where there are fewer than `farthest` of them, each is taken once and
    the rest are repeats at random, so that no single Gaussian outweighs the others.

    The choice depends on distances only, hence not on the world's orientation except through rounding: call it in a
    frame fixed to the rig where bit-equal choices matter.

    Args:
        gaussians: any number of them.
        key: the same key and Gaussians give the same choice.
        config: sizes.
        count: how many of the leading Gaussians are real; the others must repeat real ones. All if None; at least 1.
    """
    draw, repeat, last = jax.random.split(key, 3)
    total = jnp.asarray(gaussians.mean.shape[0] if count is None else count)
    if gaussians.mean.shape[0] > config.draw:
        drawn = jax.random.randint(draw, (config.draw,), 0, total)
        total = jnp.asarray(config.draw)
    else:
        drawn = jnp.arange(gaussians.mean.shape[0])
    far = farthest_points(gaussians.mean[drawn], config.farthest)
    spare = jax.random.randint(repeat, (config.farthest,), 0, total)
    far = jnp.where(jnp.arange(config.farthest) < total, far, spare)
    kept = jax.random.permutation(last, config.farthest)[: config.keep]
    index = drawn[far[kept]]
    return jax.tree.map(lambda leaf: leaf[index], gaussians)
