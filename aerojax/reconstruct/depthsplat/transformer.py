"""The multi-view transformer: windows of one view attend to themselves and to the same windows of other views.

(UniMatch, Xu et al. 2023; shifted windows, Liu et al. 2021.)
"""

from __future__ import annotations

import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from flax import nnx
from jaxtyping import Array, Bool, Float, Float32, Int

from aerojax.core.types import pytree_dataclass
from aerojax.reconstruct.depthsplat.config import DepthSplatSizes
from aerojax.reconstruct.depthsplat.draws import Draws
from aerojax.reconstruct.depthsplat.layers import LayerNorm, Linear, gelu

HIDDEN = -1e9
"""Added to scores of keys that do not exist: their share is zero in every type of numbers."""
OTHER_REGION = -100.0
"""Added to scores between regions of a shifted window that are no neighbours in the image."""


@pytree_dataclass
class Neighbours:
    """The views that each view is compared with.

    index: of the other views, nearest first; counts: whether such a view is there.
    """

    index: Int[Array, "view other"]
    counts: Bool[Array, "view other"]


def neighbours_of(centres: Float[Array, "view 3"], valid: Bool[Array, "view"], most: int) -> Neighbours:
    """The nearest valid views of each, by the distance of the cameras' centres, `most` of them at most.

    Up to three views stand in their own order, as upstream has it; which of equally far views are left out where there
    are more than `most` is not determined.
    """
    views = len(centres)
    between = centres[:, None] - centres[None]
    distance = jnp.sum(between * between, axis=-1)
    if views <= 3:
        distance = jnp.broadcast_to(jnp.arange(views, dtype=distance.dtype)[None], distance.shape)
    distance = jnp.where(valid[None], distance, jnp.inf)
    distance = jnp.where(jnp.eye(views, dtype=bool), -1.0, distance)
    index = jnp.argsort(distance, axis=-1)[:, 1 : 1 + min(most, views - 1)]
    return Neighbours(index, valid[index])


class Attention(nnx.Module):
    """One head of attention whose message is projected and normalised."""

    def __init__(self, width: int, *, draws: Draws):
        self.query, self.key, self.value, self.merge = (Linear(width, width, draws=draws, bias=False) for _ in range(4))
        self.norm = LayerNorm(width)

    def __call__(
        self,
        source: Float[Array, "view window token width"],
        target: Float[Array, "view window key width"],
        bias: Float[Array, "one_or_view one_or_window one_or_token key"],
    ) -> Float[Array, "view window token width"]:
        """The message; `bias` is added to the scores."""
        query, key, value = self.query(source), self.key(target), self.value(target)
        scores = jnp.einsum("vntc,vnkc->vntk", query, key) / math.sqrt(query.shape[-1])
        share = jax.nn.softmax(scores + bias.astype(scores.dtype), axis=-1)
        return self.norm(self.merge(jnp.einsum("vntk,vnkc->vntc", share, value)))


class FeedForward(nnx.Module):
    """Of a feature and its message: widen, GELU, narrow, normalise."""

    def __init__(self, width: int, expansion: int, *, draws: Draws):
        self.widen = Linear(2 * width, 2 * width * expansion, draws=draws, bias=False)
        self.narrow = Linear(2 * width * expansion, width, draws=draws, bias=False)
        self.norm = LayerNorm(width)

    def __call__(
        self, x: Float[Array, "*batch width"], message: Float[Array, "*batch width"]
    ) -> Float[Array, "*batch width"]:
        """The new message."""
        return self.norm(self.narrow(gelu(self.widen(jnp.concatenate([x, message], axis=-1)))))


class MultiViewBlock(nnx.Module):
    """Attention within each view, then attention to the other views with a feed-forward layer behind."""

    def __init__(self, config: DepthSplatSizes, *, draws: Draws):
        self.own = Attention(config.width, draws=draws)
        self.other = Attention(config.width, draws=draws)
        self.forward = FeedForward(config.width, config.expansion, draws=draws)
        self.splits, self.compat = config.windows, config.compat

    def attend_self(
        self, x: Float[Array, "view height width channel"], *, shifted: bool
    ) -> Float[Array, "view height width channel"]:
        """The features with what their own view's windows say."""
        own = windows(x, self.splits, shifted=shifted)
        bias = self._region_bias(x.shape[1], 1, shifted)[None]
        return x + merged(self.own(own, own, bias), self.splits, shifted=shifted)

    def __call__(
        self, x: Float[Array, "view height width channel"], neighbours: Neighbours, *, shifted: bool
    ) -> Float[Array, "view height width channel"]:
        """One block; all views' keys are those before the block, as upstream has it."""
        view, other = neighbours.index.shape
        after_self = self.attend_self(x, shifted=shifted)
        keys = windows(x, self.splits, shifted=shifted)[neighbours.index]
        keys = jnp.moveaxis(keys, 1, 2).reshape(view, self.splits**2, -1, x.shape[-1])
        absent = jnp.repeat(jnp.where(neighbours.counts, 0.0, HIDDEN), keys.shape[2] // other, axis=-1)
        bias = self._region_bias(x.shape[1], other, shifted)[None] + absent[:, None, None, :]
        message = self.other(windows(after_self, self.splits, shifted=shifted), keys, bias)
        # A view without neighbours hears nothing.
        heard = jnp.any(neighbours.counts, axis=-1).astype(x.dtype)[:, None, None, None]
        message = merged(message, self.splits, shifted=shifted) * heard
        return after_self + self.forward(after_self, message)

    def _region_bias(self, cells: int, views: int, shifted: bool) -> Float[Array, "one_or_window one_or_token key"]:
        """0 where a key's region is that of the token, `OTHER_REGION` elsewhere; keys follow each other view by view.

        Made where it is used: for all tokens and keys it is too large to be stored.
        """
        tokens = (cells // self.splits) ** 2
        if not shifted:
            return jnp.zeros((1, 1, views * tokens))
        own = window_regions(cells, self.splits)
        at = np.tile(np.arange(tokens), views)
        if self.compat:
            # Upstream's keys follow each other token by token, but its mask view by view.
            at = ((np.arange(tokens)[None] * views + np.arange(views)[:, None]) % tokens).ravel()
        same = jnp.asarray(own)[:, :, None] == jnp.asarray(own[:, at])[:, None]
        return jnp.where(same, 0.0, OTHER_REGION)


class MultiViewTransformer(nnx.Module):
    """Blocks without and with shifted windows in turn, on features with a position within their window."""

    def __init__(self, config: DepthSplatSizes, *, draws: Draws):
        self.blocks = draws.stacked(lambda part: MultiViewBlock(config, draws=part), config.blocks)
        self.splits = config.windows

    def positioned(self, x: Float[Array, "view height width channel"]) -> Float[Array, "view height width channel"]:
        """The features plus the sine embedding of the cell's place in its window."""
        side = x.shape[1] // self.splits
        embedding = np.tile(window_positions(side, x.shape[-1]), (self.splits, self.splits, 1))
        return x + jnp.asarray(embedding, x.dtype)[None]

    def __call__(
        self, x: Float[Array, "view height width channel"], neighbours: Neighbours
    ) -> Float[Array, "view height width channel"]:
        """Features that know of the other views."""

        def pair(x: Array, blocks: MultiViewBlock) -> tuple[Array, None]:
            for index, shifted in enumerate((False, True)):
                block = jax.tree.map(lambda leaf, index=index: leaf[index], blocks)
                x = block(x, neighbours, shifted=shifted)
            return x, None

        pairs = jax.tree.map(lambda leaf: leaf.reshape(-1, 2, *leaf.shape[1:]), self.blocks)
        return jax.lax.scan(pair, self.positioned(x), pairs)[0]


def windows(
    x: Float[Array, "view height width channel"], splits: int, *, shifted: bool
) -> Float[Array, "view window token channel"]:
    """Tokens of `splits`² windows, which begin half a window further where they are shifted."""
    side = x.shape[1] // splits
    return _split(jnp.roll(x, (-(side // 2), -(side // 2)), axis=(1, 2)) if shifted else x, splits)


def _split(x: Any, splits: int) -> Any:
    """Of NumPy and JAX arrays alike."""
    view, side, _, channel = x.shape
    small = side // splits
    x = x.reshape(view, splits, small, splits, small, channel).transpose(0, 1, 3, 2, 4, 5)
    return x.reshape(view, splits**2, small**2, channel)


def merged(
    x: Float[Array, "view window token channel"], splits: int, *, shifted: bool
) -> Float[Array, "view height width channel"]:
    """Inverse of `windows`."""
    view, _, tokens, channel = x.shape
    small = math.isqrt(tokens)
    x = x.reshape(view, splits, splits, small, small, channel).transpose(0, 1, 3, 2, 4, 5)
    x = x.reshape(view, splits * small, splits * small, channel)
    return jnp.roll(x, (small // 2, small // 2), axis=(1, 2)) if shifted else x


def window_regions(cells: int, splits: int) -> Float32[np.ndarray, "window token"]:
    """Numbers of the parts of shifted windows that belong together in the image."""
    small = cells // splits
    shift = small // 2
    # Along one axis: the windows before the last one, then its two parts, which the roll brought together.
    along = np.repeat([0.0, 1.0, 2.0], [cells - small, small - shift, shift]).astype(np.float32)
    return _split((3 * along[:, None] + along[None])[None, :, :, None], splits)[0, :, :, 0]


def window_positions(side: int, channels: int) -> Float32[np.ndarray, "side side channel"]:
    """Sine embedding of row and column, half of the channels each (Vaswani et al. 2017 with DETR's normalisation)."""
    count = channels // 2
    place = np.arange(1, side + 1) / (side + 1e-6) * 2 * np.pi
    wavelength = 10000.0 ** (2 * (np.arange(count) // 2) / count)
    phase = place[:, None] / wavelength[None]
    waves = np.where(np.arange(count) % 2 == 0, np.sin(phase), np.cos(phase))
    rows = np.broadcast_to(waves[:, None], (side, side, count))
    columns = np.broadcast_to(waves[None], (side, side, count))
    return np.concatenate([rows, columns], axis=-1).astype(np.float32)
