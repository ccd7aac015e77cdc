"""The spatial encoder: a vector-neuron transformer over the Gaussians of one frame."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from flax import nnx
from jaxtyping import Array, Bool, Float, Key

from aerojax.classify.config import MambaSplatConfig
from aerojax.classify.vector_neurons import Init, VNLayerNorm, VNLinear, VNRectifier, VNRMSNorm

FEED_FORWARD_FACTOR = 4


def weight_init(config: MambaSplatConfig) -> Init:
    """The published code draws every vector-neuron weight with variance 1."""
    return "unit" if config.variant == "published" else "fan_in"


def bias_epsilon(config: MambaSplatConfig) -> float:
    """Only the published variant has vector biases."""
    return config.bias_epsilon if config.variant == "published" else 0.0


def vector_norm(config: MambaSplatConfig) -> VNLayerNorm | VNRMSNorm:
    """The variant's norm over a token's channels."""
    return VNLayerNorm(config.channels) if config.variant == "published" else VNRMSNorm(config.channels)


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
        scores = jnp.einsum("hnf,hmf->hnm", q * q.shape[-1] ** -0.5, k)
        weights = jax.nn.softmax(jnp.where(mask, scores, -1e30), axis=-1)
        mixed = jnp.einsum("hnm,hmf->hnf", weights, v * mask.any())
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
