"""Mamba4D: tubes of a clip, a state-space model within each frame's tubes and another over all of them.

(Liu et al. 2025, CVPR, Mamba4D; sizes, order of tubes and recipe as in the released `models/msr.py`.)
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
from flax import nnx
from jaxtyping import Array, Bool, Float, Int, Key

from aerojax.classify.baselines.batch_norm import BatchNorm
from aerojax.classify.baselines.config import Mamba4DConfig, Mamba4DSizes
from aerojax.classify.baselines.p4transformer import ClipHead
from aerojax.classify.baselines.tubes import OFFSETS, Tubes, tubes, valid_anchor_frames, with_time
from aerojax.classify.mambasplat.config import MambaSplatConfig
from aerojax.classify.mambasplat.layers import LayerNorm, Linear, drop
from aerojax.classify.mambasplat.mamba import MambaLayer, MambaMixer

_FAR = -1e9
LONG = 8
"""Tokens beyond which `mixed_sequence` goes token by token: of eight clips, an eighth of the time and of the memory."""
_AXES = (2, 0, 1)
"""The tubes come three times: in the orders of z, x and y."""


class PointEncoder(nnx.Module):
    """The points of a ball, at their own coordinates, become one vector: two shared MLPs, each with a maximum."""

    def __init__(self, sizes: Mamba4DSizes, *, key: Key[Array, ""]):
        first, second, third, fourth = jax.random.split(key, 4)
        one, two, four = sizes.point
        self.first, self.first_norm = Linear(3, one, key=first), BatchNorm(one)
        self.second = Linear(one, two, key=second)
        self.third, self.third_norm = Linear(2 * two, four, key=third), BatchNorm(four)
        self.fourth = Linear(four, sizes.width, key=fourth)

    def __call__(
        self, points: Float[Array, "row tube near 3"], counts: Float[Array, "row"] | None = None
    ) -> Float[Array, "row tube width"]:
        """Encode every ball; `counts` as of `BatchNorm`."""
        x = self.second(jax.nn.relu(self.first_norm(self.first(points), counts)))
        highest = jnp.broadcast_to(x.max(axis=2, keepdims=True), x.shape)
        x = self.third(jnp.concatenate([highest, x], axis=-1))
        return self.fourth(jax.nn.relu(self.third_norm(x, counts))).max(axis=2)


class MixerStack(nnx.Module):
    """The residual stack of `MambaStack`, scanned layer by layer and with one rate of drop path for all layers."""

    def __init__(self, width: int, layers: int, config: Mamba4DConfig, *, key: Key[Array, ""]):
        layer = MambaSplatConfig(d_model=width, mamba_layers=layers)
        self.layers = jax.vmap(lambda each: MambaLayer(layer, key=each))(jax.random.split(key, layers))
        self.norm = LayerNorm(width)
        self.count, self.dropout, self.drop_path = layers, config.dropout, config.drop_path

    def __call__(
        self, hidden: Float[Array, "token width"], *, key: Key[Array, ""] | None = None
    ) -> Float[Array, "token width"]:
        """Mix a sequence; `key` turns on dropout."""
        keys = None if key is None else jax.random.split(key, (self.count, 2))

        def step(carry: tuple[Array, Array], inputs: tuple[MambaLayer, Array | None]) -> tuple:
            (hidden, residual), (layer, key) = carry, inputs
            path, element = (None, None) if key is None else key
            residual = residual + drop(hidden, self.drop_path, key=path, whole=True)
            return (drop(mixed_sequence(layer.mixer, layer.norm(residual)), self.dropout, key=element), residual), None

        # The first layer has no layer before it whose output could be dropped: its input is the residual.
        first = jax.tree.map(lambda leaf: leaf[0], self.layers)
        rest = jax.tree.map(lambda leaf: leaf[1:], self.layers)
        opened = mixed_sequence(first.mixer, first.norm(hidden))
        opened = drop(opened, self.dropout, key=None if keys is None else keys[0, 1])
        following = None if keys is None else keys[1:]
        (mixed, residual), _ = jax.lax.scan(step, (opened, hidden), (rest, following))
        return self.norm(mixed + residual)


def mixed_sequence(mixer: MambaMixer, u: Float[Array, "token width"]) -> Float[Array, "token width"]:
    """Mix a sequence; on a processor a long one token by token, because it is faster there and needs less memory."""
    return mixer(u) if len(u) <= LONG or jax.default_backend() != "cpu" else mixer.in_order(u)


class IntraFrame(nnx.Module):
    """One vector for each tube: its balls encoded, mixed along the tubes of a frame, the highest of three frames."""

    def __init__(self, sizes: Mamba4DSizes, config: Mamba4DConfig, *, key: Key[Array, ""]):
        points, hidden, position, mixer = jax.random.split(key, 4)
        self.points = PointEncoder(sizes, key=points)
        self.position_hidden = Linear(4, sizes.position, key=hidden)
        self.position = Linear(sizes.position, sizes.width, key=position)
        self.mixer = MixerStack(sizes.width, sizes.intra, config, key=mixer)
        self.norm = LayerNorm(sizes.width)

    def __call__(
        self, cut: Tubes, counts: Float[Array, "anchor_frame"] | None = None, *, key: Key[Array, ""] | None = None
    ) -> Float[Array, "anchor_frame tube width"]:
        """Describe every tube; `counts` as of `BatchNorm`, `key` turns on dropout."""
        frames, offsets, number = cut.points.shape[:3]
        rows = None if counts is None else jnp.repeat(counts, offsets)
        balls = self.points(cut.points.reshape(frames * offsets, *cut.points.shape[2:]), rows)
        tokens = balls + self._positions(cut.anchors).reshape(frames * offsets, number, -1)
        if key is None:
            mixed = jax.vmap(self.mixer)(tokens)
        else:
            keys = jax.random.split(key, frames * offsets)
            mixed = jax.vmap(lambda sequence, each: self.mixer(sequence, key=each))(tokens, keys)
        return self.norm(mixed).reshape(frames, offsets, number, -1).max(axis=1)

    def _positions(self, anchors: Float[Array, "anchor_frame tube 3"]) -> Array:
        """An MLP of the anchor and of the frame that the ball is in, relative to the anchor's."""
        shape = (anchors.shape[0], len(OFFSETS), anchors.shape[1])
        step = jnp.broadcast_to(jnp.asarray(OFFSETS, anchors.dtype).reshape(1, -1, 1, 1), (*shape, 1))
        where = jnp.concatenate([jnp.broadcast_to(anchors[:, None], (*shape, 3)), step], axis=-1)
        return self.position(jax.nn.gelu(self.position_hidden(where), approximate=False))


class Mamba4D(nnx.Module):
    """The network; the linear map of 4,096 numbers that the released code makes and never reads is left out."""

    def __init__(self, sizes: Mamba4DSizes, config: Mamba4DConfig, *, key: Key[Array, ""]):
        intra, position, inter, head = jax.random.split(key, 4)
        self.tubes, self.true_sort = sizes.tubes, config.true_sort
        self.intra = IntraFrame(sizes, config, key=intra)
        self.position = Linear(4, sizes.width, key=position)
        self.inter = MixerStack(sizes.width, sizes.inter, config, key=inter)
        self.head = ClipHead(sizes.width, sizes.hidden, config.classes, key=head)

    def __call__(
        self,
        points: Float[Array, "time token 3"],
        count: Int[Array, ""],
        *,
        key: Key[Array, ""] | None = None,
    ) -> Float[Array, "label"]:
        """Logits of one clip.

        Args:
            points: of `count` frames and then of any others.
            count: frames that are there, at least 1.
            key: turns on dropout and the batch's statistics, for which the call has to stand as `BatchNorm` says.
        """
        within, over = (None, None) if key is None else jax.random.split(key)
        valid = valid_anchor_frames(count, points.shape[0])
        return self.answer(*self.embedded(points, count, key=within), valid, key=over)

    def embedded(
        self, points: Float[Array, "time token 3"], count: Int[Array, ""], *, key: Key[Array, ""] | None = None
    ) -> tuple[Float[Array, "anchor_frame tube 3"], Float[Array, "anchor_frame tube width"]]:
        """Anchors, and what the tubes about them hold."""
        cut = tubes(points, count, self.tubes)
        valid = valid_anchor_frames(count, points.shape[0])
        counts = None if key is None else valid.astype(points.dtype)
        return cut.anchors, self.intra(cut, counts, key=key)

    def answer(
        self,
        anchors: Float[Array, "anchor_frame tube 3"],
        features: Float[Array, "anchor_frame tube width"],
        valid: Bool[Array, "anchor_frame"],
        *,
        key: Key[Array, ""] | None = None,
    ) -> Float[Array, "label"]:
        """Logits from the tubes of the valid anchor frames."""
        tokens = (features + self.position(with_time(anchors))).reshape(-1, features.shape[-1])
        order = jnp.concatenate([tube_order(anchors[..., axis], self.true_sort) for axis in _AXES])
        counted = jnp.repeat(valid, features.shape[1])[order]
        # The layers are causal: with the tubes that count in front, no other one reaches them.
        front = jnp.argsort(~counted, stable=True)
        mixed = self.inter(tokens[order[front]], key=key)
        return self.head(jnp.where(counted[front][:, None], mixed, _FAR).max(axis=0))


def tube_order(coordinate: Float[Array, "anchor_frame tube"], true_sort: bool) -> Int[Array, "order"]:
    """The order in which all tubes of a clip are read along one axis, as indices of `coordinate.reshape(-1)`.

    With `true_sort` the lowest tubes of all frames come first, then the second lowest ones, and so on. The released
    code sorts, stably, by the numbers that sorting each frame gives. Those are indices and no ranks, so it takes, for
    each i, of every frame the place that tube i has in the frame's sorted order.
    """
    frames, number = coordinate.shape
    sorted_tubes = jnp.argsort(coordinate, axis=1)
    if not true_sort:
        return jnp.argsort(sorted_tubes.reshape(-1), stable=True)
    return (sorted_tubes + number * jnp.arange(frames)[:, None]).T.reshape(-1)
