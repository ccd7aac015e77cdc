"""The spatial encoder: a vector-neuron transformer over the Gaussians of one frame."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from flax import nnx
from jaxtyping import Array, Bool, Float, Key

from aerojax.classify.config import MambaSplatConfig
from aerojax.classify.vector_neurons import Init, VNLayerNorm, VNLinear, VNRectifier, VNRMSNorm

FEED_FORWARD_FACTOR = 4
QUERY_BLOCK = 128
"""Rows of scores that exist at once: four heads of 128 x 1024 floats are 2 MiB, so they stay in a cache."""
LARGE_FRAME = 256
"""Tokens up to which all scores of a frame fit in memory and cache at once."""


def weight_init(config: MambaSplatConfig) -> Init:
    """The published code draws every vector-neuron weight with variance 1."""
    return "unit" if config.variant == "published" else "fan_in"


def bias_epsilon(config: MambaSplatConfig) -> float:
    """Only the published variant has vector biases."""
    return config.bias_epsilon if config.variant == "published" else 0.0


def vector_norm(config: MambaSplatConfig) -> VNLayerNorm | VNRMSNorm:
    """The variant's norm over a token's channels."""
    return VNLayerNorm(config.channels) if config.variant == "published" else VNRMSNorm(config.channels)


def attend(
    q: Float[Array, "head query feature"],
    k: Float[Array, "head token feature"],
    v: Float[Array, "head token value"],
    mask: Bool[Array, "token"],
) -> Float[Array, "head query value"]:
    """Softmax attention to the valid tokens; the mean of all where none is valid."""
    scores = jnp.where(mask, jnp.einsum("hnf,hmf->hnm", q, k), -1e30)
    return jnp.einsum("hnm,hmf->hnf", jax.nn.softmax(scores, axis=-1), v)


def attend_in_blocks(
    q: Float[Array, "head query feature"],
    k: Float[Array, "head token feature"],
    v: Float[Array, "head token value"],
    mask: Bool[Array, "token"],
    *,
    block: int = QUERY_BLOCK,
) -> Float[Array, "head query value"]:
    """`attend`, `block` queries after another: memory grows with the tokens and not with their square.

    Each query sees all tokens at once, so nothing has to be rescaled between blocks; the gradient computes a block's
    scores again (Rabe & Staats 2021, without their blocks of keys).
    """
    heads, queries, _ = q.shape
    count = -(-queries // block)
    rows = jnp.pad(q, ((0, 0), (0, count * block - queries), (0, 0))).reshape(heads, count, block, -1)
    mixed = jax.lax.map(jax.checkpoint(lambda few: attend(few, k, v, mask)), rows.swapaxes(0, 1))
    return mixed.swapaxes(0, 1).reshape(heads, count * block, -1)[:, :queries]


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
        mix = attend if tokens <= LARGE_FRAME else attend_in_blocks
        mixed = mix(q * q.shape[-1] ** -0.5, k, v * mask.any(), mask)
        mixed = mixed.reshape(self.heads, tokens, slots, -1).transpose(1, 2, 0, 3)
        return self.to_out(mixed.reshape(tokens, slots, -1))


class VNFeedForward(nnx.Module):
    """Widen, rectify, narrow.

    The published form maps 14→56 and then 56→56 twice inside the rectifier. No nonlinearity lies between the two, so
    the exact variant writes each product as one 14→56 map: the same functions at a fifth of the cost.
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
        return self.narrow(self.rectify(x if self.widen is None else self.widen(x)))


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
