"""The views network: crops of a clip in, class logits out.

Cameras are pooled by mean, maximum and standard deviation, so neither their order nor their number is built in. Time is
read by the Mamba layers of `mambasplat`; the answer is made of the running mean of their output and of the running
standard deviation of the frames' descriptors, because what tells a bird from an airplane is often what changes.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
from flax import nnx
from jaxtyping import Array, Bool, Float, Key

from aerojax.classify.mambasplat.layers import LayerNorm, Linear, drop
from aerojax.classify.mambasplat.mamba import MambaStack, MambaState
from aerojax.classify.views.config import MOST_VIEWS, ViewsConfig
from aerojax.classify.views.descriptors import OUTLINE_DESCRIPTORS, descriptor_count
from aerojax.classify.views.encoder import Outline, ViewEncoder, outline
from aerojax.classify.views.polar import LEAST_AREA, last_before
from aerojax.core.errors import UserError
from aerojax.core.types import pytree_dataclass


@pytree_dataclass
class ViewsState:
    """What the network remembers of a stream.

    before: each camera's outline when it last showed the object, for `MOST_VIEWS` cameras.
    seen: cameras that have one.
    temporal: of the Mamba layers.
    sums: over the frames that counted: encoded, descriptor, descriptor squared.
    count: of those frames.
    outlines: sums of `outline_descriptors` over the views that counted, and how many did.
    """

    before: Outline
    seen: Bool[Array, "slot"]
    temporal: MambaState
    sums: Float[Array, "3 width"]
    count: Float[Array, ""]
    outlines: Float[Array, "descriptors_and_count"]


class ViewPooling(nnx.Module):
    """Descriptors of the views that count → a frame's descriptor: mean, maximum, deviation → linear → LayerNorm."""

    def __init__(self, config: ViewsConfig, *, key: Key[Array, ""]):
        self.linear = Linear(3 * config.view_width, config.d_model, key=key)
        self.norm = LayerNorm(config.d_model)

    def __call__(self, views: Float[Array, "view feature"], valid: Bool[Array, "view"]) -> Float[Array, "width"]:
        """Pool; finite where no view counts."""
        weight = valid.astype(views.dtype)[:, None]
        count = jnp.maximum(weight.sum(), 1.0)
        mean = jnp.sum(views * weight, axis=0) / count
        highest = jnp.max(jnp.where(valid[:, None], views, -1e9), axis=0)
        highest = jnp.where(valid.any(), highest, jnp.zeros_like(highest))
        variance = jnp.sum((views - mean[None]) ** 2 * weight, axis=0) / count
        return self.norm(self.linear(jnp.concatenate([mean, highest, jnp.sqrt(variance + 1e-6)])))


class ViewsHead(nnx.Module):
    """LayerNorm → linear → ReLU → dropout → linear."""

    def __init__(self, config: ViewsConfig, *, key: Key[Array, ""]):
        hidden, out = jax.random.split(key)
        self.hidden = Linear(2 * config.d_model, config.d_model // 2, key=hidden)
        self.out = Linear(config.d_model // 2, config.classes, key=out)
        self.rate = config.head_dropout

    def __call__(self, z: Float[Array, "width"], *, key: Key[Array, ""] | None = None) -> Float[Array, "label"]:
        """Logits of one readout."""
        return self.out(drop(jax.nn.relu(self.hidden(z)), self.rate, key=key))


class ViewsNetwork(nnx.Module):
    """The network.

    Its answer depends on images alone. So it does not change at all when world and cameras turn or move together, and
    not when the cameras come in another order; a roll of a camera about its axis changes it by interpolation only.
    Where cameras stand is not read.
    """

    def __init__(self, config: ViewsConfig, *, key: Key[Array, ""]):
        encoder, pool, temporal, head = jax.random.split(key, 4)
        self.config = config
        self.encoder = ViewEncoder(config, key=encoder)
        self.pool = ViewPooling(config, key=pool)
        self.temporal = MambaStack(config.temporal, key=temporal)
        self.head = ViewsHead(config, key=head)

    def __call__(
        self,
        rgba: Float[Array, "time view size size 4"],
        valid: Bool[Array, "time view"],
        *,
        key: Key[Array, ""] | None = None,
    ) -> Float[Array, "label"]:
        """Classify one clip.

        Args:
            rgba: crops, premultiplied sRGB and coverage, 0..1; those that do not count may hold anything.
            valid: crops that count. A frame without any is as if it had not been recorded.
            key: turns on dropout.
        """
        read_key, head_key = (None, None) if key is None else jax.random.split(key)
        return self.head(self.readouts(rgba, valid, key=read_key)[0][-1], key=head_key)

    def readouts(
        self,
        rgba: Float[Array, "time view size size 4"],
        valid: Bool[Array, "time view"],
        *,
        key: Key[Array, ""] | None = None,
    ) -> tuple[Float[Array, "time twice_width"], Bool[Array, "time"]]:
        """What the head reads after each frame, zero before the first that counts, and whether there was one."""
        view_key, layer_key = (None, None) if key is None else jax.random.split(key)
        features, counts = self.frame_features(rgba, valid, key=view_key)
        # The layers are causal: with the frames that count in front, no other one reaches them.
        order = jnp.argsort(~counts, stable=True)
        features, weight = features[order], counts[order].astype(features.dtype)[:, None]
        encoded = self.temporal(features, key=layer_key)
        rows = jnp.stack([encoded, features, features * features], axis=1) * weight[:, None]
        sums, number = jnp.cumsum(rows, axis=0), jnp.cumsum(counts)
        reached = sums[jnp.maximum(number - 1, 0)]
        return jax.vmap(_readout)(reached, number.astype(features.dtype)), number > 0

    def outline_means(
        self, rgba: Float[Array, "time view size size 4"], valid: Bool[Array, "time view"]
    ) -> Float[Array, "time descriptor"]:
        """Mean of `outline_descriptors` over all views that counted so far, zero before the first."""
        sums = jnp.cumsum(jax.vmap(_outline_sums)(*self._look(rgba, valid)), axis=0)
        return jax.vmap(outline_mean)(sums)

    def frame_features(
        self,
        rgba: Float[Array, "time view size size 4"],
        valid: Bool[Array, "time view"],
        *,
        key: Key[Array, ""] | None = None,
    ) -> tuple[Float[Array, "time width"], Bool[Array, "time"]]:
        """Each frame's descriptor, and which frames count."""
        now, valid = self._look(rgba, valid)
        index, seen = last_before(valid)
        camera = jnp.arange(valid.shape[1])[None]
        before = _where(seen, jax.tree.map(lambda leaf: leaf[index, camera], now), now)
        views = jax.vmap(jax.vmap(self.encoder))(now, before)
        views = drop(views, self.config.view_dropout, key=key)
        return jax.vmap(self.pool)(views, valid), valid.any(axis=1)

    def initial_state(self) -> ViewsState:
        """The state of a stream before its first frame."""
        kind, config = jax.tree.leaves(self)[0].dtype, self.config
        before = Outline(
            jnp.zeros(MOST_VIEWS, kind),
            jnp.zeros((MOST_VIEWS, config.radii, config.angles, config.channels), kind),
            jnp.zeros((MOST_VIEWS, descriptor_count(config.radii, config.harmonics)), kind),
        )
        sums = jnp.zeros((3, config.d_model), kind)
        seen = jnp.zeros(MOST_VIEWS, bool)
        outlines = jnp.zeros(OUTLINE_DESCRIPTORS + 1, kind)
        return ViewsState(before, seen, self.temporal.initial_state(), sums, jnp.zeros((), kind), outlines)

    def advance(
        self, rgba: Float[Array, "view size size 4"], valid: Bool[Array, "view"], state: ViewsState
    ) -> tuple[Float[Array, "twice_width"], ViewsState]:
        """What the head reads after one more frame of a stream; equal to `readouts` of all frames so far.

        Raises:
            UserError: more cameras than `MOST_VIEWS`.
        """
        if (views := valid.shape[0]) > MOST_VIEWS:
            raise UserError("mismatch", f"{views} cameras, but a stream remembers {MOST_VIEWS}", "leave some out")
        now, valid = self._look(rgba[None], valid[None])
        now, valid = jax.tree.map(lambda leaf: leaf[0], (now, valid))
        last, rest = (jax.tree.map(lambda leaf, part=part: leaf[part], state.before) for part in _split(views))
        features = jax.vmap(self.encoder)(now, _where(state.seen[:views], last, now))
        feature = self.pool(features, valid)
        encoded, temporal = self.temporal.step(feature, state.temporal)
        kept = _where(valid, now, last)
        before = jax.tree.map(lambda new, old: jnp.concatenate([new, old]), kept, rest)
        seen = state.seen.at[:views].set(state.seen[:views] | valid)
        sums = state.sums + jnp.stack([encoded, feature, feature * feature])
        outlines = state.outlines + _outline_sums(now, valid)
        following = ViewsState(before, seen, temporal, sums, state.count + 1, outlines)
        following = jax.tree.map(lambda new, old: jnp.where(valid.any(), new, old), following, state)
        return _readout(following.sums, following.count), following

    def _look(
        self, rgba: Float[Array, "time view size size 4"], valid: Bool[Array, "time view"]
    ) -> tuple[Outline, Bool[Array, "time view"]]:
        """Outlines, and which views count: those that are valid and show something."""
        rgba = jnp.where(valid[..., None, None, None], rgba, jnp.zeros((), rgba.dtype))
        found = jax.vmap(jax.vmap(lambda crop: outline(crop, self.config)))(rgba)
        return found, valid & (found.area > LEAST_AREA)


def _readout(sums: Float[Array, "3 width"], count: Float[Array, ""]) -> Float[Array, "twice_width"]:
    """Mean of what the layers gave and deviation of the descriptors, zero before the first frame."""
    encoded, mean, square = sums / jnp.maximum(count, 1.0)
    # The small term keeps the root's slope finite where nothing changes.
    deviation = jnp.sqrt(jnp.maximum(square - mean * mean, 0.0) + 1e-4) - 1e-2
    return jnp.where(count > 0, jnp.concatenate([encoded, deviation]), 0.0)


def _outline_sums(now: Outline, valid: Bool[Array, "view"]) -> Float[Array, "descriptors_and_count"]:
    """Of one frame."""
    numbers = now.numbers[:, :OUTLINE_DESCRIPTORS]
    rows = jnp.concatenate([numbers, jnp.ones_like(numbers[:, :1])], axis=1)
    return jnp.sum(jnp.where(valid[:, None], rows, 0.0), axis=0)


def outline_mean(sums: Float[Array, "descriptors_and_count"]) -> Float[Array, "descriptor"]:
    """Of sums as `ViewsState` has them; zero where nothing counted."""
    return sums[:-1] / jnp.maximum(sums[-1], 1.0)


def _where(condition: Bool[Array, "*batch"], yes: Outline, no: Outline) -> Outline:
    def choose(a: Array, b: Array) -> Array:
        return jnp.where(condition.reshape(condition.shape + (1,) * (a.ndim - condition.ndim)), a, b)

    return jax.tree.map(choose, yes, no)


def _split(views: int) -> tuple[slice, slice]:
    return slice(None, views), slice(views, None)
