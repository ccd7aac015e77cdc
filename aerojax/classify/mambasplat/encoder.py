"""The spatial encoder: a vector-neuron transformer over the Gaussians of one frame."""

from __future__ import annotations

from functools import partial

import jax
import jax.numpy as jnp
from flax import nnx
from jaxtyping import Array, Bool, Float, Key

from aerojax.classify.mambasplat.config import MambaSplatConfig
from aerojax.classify.mambasplat.vector_neurons import Init, VNLayerNorm, VNLinear, VNRectifier, VNRMSNorm

FEED_FORWARD_FACTOR = 4
SMALLEST_BLOCK = 128
MOST_BLOCKS = 4
"""Queries are mixed in so many blocks of at least so many rows: the scores of one fit in a cache."""
LARGE_FRAME = 256
"""Tokens up to which frames are encoded side by side."""


def weight_init(config: MambaSplatConfig) -> Init:
    """The published code draws every vector-neuron weight with variance 1."""
    return "unit" if config.variant == "published" else "fan_in"


def bias_epsilon(config: MambaSplatConfig) -> float:
    """Only the published variant has vector biases."""
    return config.bias_epsilon if config.variant == "published" else 0.0


def vector_norm(config: MambaSplatConfig) -> VNLayerNorm | VNRMSNorm:
    """The variant's norm over a token's channels."""
    return VNLayerNorm(config.channels) if config.variant == "published" else VNRMSNorm(config.channels)


@partial(jax.custom_vjp, nondiff_argnums=(4,))
def attend(
    q: Float[Array, "head query feature"],
    k: Float[Array, "head token feature"],
    v: Float[Array, "head token value"],
    mask: Bool[Array, "token"],
    block: int,
) -> Float[Array, "head query value"]:
    """Softmax attention to the valid tokens; the mean of all where none is valid.

    Where there are more than `block` queries, one block follows the other, so memory grows with the tokens and not with
    their square; each query sees all tokens at once, so nothing is rescaled between blocks. The gradient keeps two
    numbers a query, its highest score and its normaliser, and computes the weights again (Rabe & Staats 2021, without
    their blocks of keys; Dao et al. 2022).
    """
    return _attend(q, k, v, mask, block)[0]


def _attend(q: Array, k: Array, v: Array, mask: Array, block: int) -> tuple[Array, Array, Array]:
    """The mixed values; each query's highest score, and the sum of the exponentials of what the others lack to it."""
    keys = _with_feature(k, _attention_bias(mask))

    def mix(q: Array) -> tuple[Array, Array, Array]:
        scores = jnp.einsum("hnf,hmf->hnm", _with_feature(q, jnp.ones(())), keys)
        highest = scores.max(axis=-1, keepdims=True)
        weights = jnp.exp(scores - highest)
        total = weights.sum(axis=-1, keepdims=True)
        return jnp.einsum("hnm,hmf->hnf", weights, v) / total, highest, total

    if q.shape[1] <= block:
        return mix(q)
    mixed, highest, total = (_from_blocks(x, q.shape[1]) for x in jax.lax.map(mix, _in_blocks(q, block)))
    return mixed, highest, total


def _attend_forward(q: Array, k: Array, v: Array, mask: Array, block: int) -> tuple[Array, tuple[Array, ...]]:
    mixed, highest, total = _attend(q, k, v, mask, block)
    return mixed, (q, k, v, mask, mixed, highest, total)


def _attend_backward(block: int, saved: tuple[Array, ...], g: Array) -> tuple[Array, Array, Array, None]:
    q, k, v, mask, mixed, highest, total = saved
    keys = _with_feature(k, _attention_bias(mask))
    g = g / total
    centre = jnp.sum(g * mixed, axis=-1, keepdims=True)

    def pull_back(q: Array, g: Array, highest: Array, centre: Array) -> tuple[Array, Array, Array]:
        # Tokens before queries: two of the three products over a score then read it along its rows.
        scores = jnp.einsum("hmf,hnf->hmn", keys, _with_feature(q, jnp.ones(())))
        weights = jnp.exp(scores - highest.swapaxes(1, 2))
        slopes = weights * (jnp.einsum("hmf,hnf->hmn", v, g) - centre.swapaxes(1, 2))
        to_q = jnp.einsum("hfm,hmn->hfn", k.swapaxes(1, 2), slopes).swapaxes(1, 2)
        return to_q, jnp.einsum("hmn,hnf->hmf", slopes, q), jnp.einsum("hmn,hnf->hmf", weights, g)

    each = (q, g, highest, centre)
    if q.shape[1] <= block:
        return *pull_back(*each), None

    def add(total: tuple[Array, Array], block: tuple[Array, ...]) -> tuple[tuple[Array, Array], Array]:
        to_q, to_k, to_v = pull_back(*block)
        return (total[0] + to_k, total[1] + to_v), to_q

    # A padded query's cotangent is zero, and so is all that it passes on.
    start = (jnp.zeros_like(k), jnp.zeros_like(v))
    (to_k, to_v), to_q = jax.lax.scan(add, start, tuple(_in_blocks(x, block) for x in each))
    return _from_blocks(to_q, q.shape[1]), to_k, to_v, None


attend.defvjp(_attend_forward, _attend_backward)


def _attention_bias(mask: Bool[Array, "token"]) -> Float[Array, "token 1"]:
    """Added to all scores of a token: 0, or so little where it is not valid that its weight is exactly zero."""
    return jnp.where(mask, 0.0, -1e30)[:, None]


def _with_feature(x: Float[Array, "head token feature"], last: Array) -> Float[Array, "head token more"]:
    """A further feature behind the others; the bias of the keys times 1 of the queries is added by the product."""
    return jnp.concatenate([x, jnp.broadcast_to(last, (*x.shape[:-1], 1)).astype(x.dtype)], axis=-1)


def _in_blocks(x: Float[Array, "head query feature"], block: int) -> Float[Array, "step head block feature"]:
    heads, queries, features = x.shape
    count = -(-queries // block)
    rows = jnp.pad(x, ((0, 0), (0, count * block - queries), (0, 0)))
    return rows.reshape(heads, count, block, features).swapaxes(0, 1)


def _from_blocks(x: Float[Array, "step head block feature"], queries: int) -> Float[Array, "head query feature"]:
    count, heads, block, features = x.shape
    return x.swapaxes(0, 1).reshape(heads, count * block, features)[:, :queries]


class VNAttention(nnx.Module):
    """Multi-head self-attention whose scores are inner products over (slot, head channel): invariant."""

    def __init__(self, config: MambaSplatConfig, *, key: Key[Array, ""]):
        keys = jax.random.split(key, 4)
        width = config.heads * config.head_dim
        init, epsilon = weight_init(config), bias_epsilon(config)
        self.to_q = VNLinear(config.channels, width, key=keys[0], init=init, bias_epsilon=epsilon)
        self.to_k = VNLinear(config.channels, width, key=keys[1], init=init, bias_epsilon=epsilon)
        self.to_v = VNLinear(config.channels, width, key=keys[2], init=init, bias_epsilon=epsilon)
        self.to_out = VNLinear(width, config.channels, key=keys[3], init=init, bias_epsilon=epsilon)
        self.heads = config.heads

    def __call__(
        self, x: Float[Array, "token slot channel"], mask: Bool[Array, "token"]
    ) -> Float[Array, "token slot channel"]:
        """Attend to the valid tokens; zero before the output map where no token is valid."""
        tokens, slots, _ = x.shape

        def by_head(layer: VNLinear) -> Float[Array, "head token feature"]:
            y = layer(x).reshape(tokens, slots, self.heads, -1)
            return y.transpose(2, 0, 1, 3).reshape(self.heads, tokens, -1)

        q, k, v = by_head(self.to_q), by_head(self.to_k), by_head(self.to_v)
        block = max(SMALLEST_BLOCK, -(-tokens // MOST_BLOCKS))
        mixed = attend(q * q.shape[-1] ** -0.5, k, jnp.where(mask.any(), v, 0.0), mask, block)
        mixed = mixed.reshape(self.heads, tokens, slots, -1).transpose(1, 2, 0, 3)
        return self.to_out(mixed.reshape(tokens, slots, -1))


class VNFeedForward(nnx.Module):
    """Widen, rectify, narrow.

    The published form maps 14→56 and then 56→56 twice inside the rectifier. No nonlinearity lies between the two, so
    each product is applied as one 14→56 map: the same functions at a fifth of the cost. The exact variant learns these.
    """

    def __init__(self, config: MambaSplatConfig, *, key: Key[Array, ""]):
        widen, rectify, narrow = jax.random.split(key, 3)
        channels, wide = config.channels, FEED_FORWARD_FACTOR * config.channels
        init, epsilon = weight_init(config), bias_epsilon(config)
        published = config.variant == "published"
        self.widen = VNLinear(channels, wide, key=widen, init=init, bias_epsilon=epsilon) if published else None
        self.rectify = VNRectifier(wide if published else channels, wide, key=rectify, init=init)
        self.narrow = VNLinear(wide, channels, key=narrow, init=init, bias_epsilon=epsilon)

    def __call__(self, x: Float[Array, "token slot channel"]) -> Float[Array, "token slot channel"]:
        """Token-wise."""
        return self.narrow(self.rectify(x) if self.widen is None else self.rectify.behind(self.widen, x))


class VNBlock(nnx.Module):
    """One transformer block; the norm acts on the branch's input (pre) or on its output (published)."""

    def __init__(self, config: MambaSplatConfig, *, key: Key[Array, ""]):
        attention, feed_forward = jax.random.split(key)
        self.attention = VNAttention(config, key=attention)
        self.attention_norm = vector_norm(config)
        self.feed_forward = VNFeedForward(config, key=feed_forward)
        self.feed_forward_norm = vector_norm(config)
        self.pre_norm = config.pre_norm

    def __call__(
        self, x: Float[Array, "token slot channel"], mask: Bool[Array, "token"]
    ) -> Float[Array, "token slot channel"]:
        """Attention, then feed-forward, each with a residual."""
        if self.pre_norm:
            x = x + self.attention(self.attention_norm(x), mask)
            return x + self.feed_forward(self.feed_forward_norm(x))
        x = x + self.attention_norm(self.attention(x, mask))
        return x + self.feed_forward_norm(self.feed_forward(x))


class VNEncoder(nnx.Module):
    """A stack of equal blocks and a last norm."""

    def __init__(self, config: MambaSplatConfig, *, key: Key[Array, ""]):
        keys = jax.random.split(key, config.depth)
        self.blocks = jax.vmap(lambda block_key: VNBlock(config, key=block_key))(keys)
        self.norm = vector_norm(config)

    def __call__(
        self, x: Float[Array, "token slot channel"], mask: Bool[Array, "token"]
    ) -> Float[Array, "token slot channel"]:
        """Encode one frame; permutes with its tokens, rotates with its first three slots."""

        def step(x: Array, block: VNBlock) -> tuple[Array, None]:
            return block(x, mask), None

        # Unrolled: a rolled loop copies every saved activation into a stacked array and back.
        return self.norm(jax.lax.scan(step, x, self.blocks, unroll=True)[0])


def masked_mean(x: Float[Array, "token *feature"], mask: Bool[Array, "token"]) -> Float[Array, "*feature"]:
    """Mean over the valid tokens; zero where there is none."""
    weights = mask.astype(x.dtype)
    return jnp.einsum("n...,n->...", x, weights) / jnp.maximum(weights.sum(), 1e-6)


def masked_max(x: Float[Array, "token feature"], mask: Bool[Array, "token"]) -> Float[Array, "feature"]:
    """Largest value over the valid tokens; zero where there is none."""
    return jnp.where(mask.any(), jnp.max(jnp.where(mask[:, None], x, -1e30), axis=0), 0.0)
