"""From equivariant features to invariant ones: the bridge between the spatial and the temporal encoder."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from flax import nnx
from jaxtyping import Array, Bool, Float, Key

from aerojax.classify.mambasplat.config import Bridge, MambaSplatConfig, frame_extras
from aerojax.classify.mambasplat.encoder import masked_max, masked_mean, weight_init
from aerojax.classify.mambasplat.layers import LayerNorm, Linear
from aerojax.classify.mambasplat.vector_neurons import VNLinear, VNRectifier

FRAME_SLOPE = 0.2


class VNFrame(nnx.Module):
    """Three vectors that rotate with the features: an MLP on each channel beside the channel mean.

    The exact variant folds each linear map into the rectifier behind it and divides the three vectors by their
    root-mean-square length, so that S = VTᵀ is linear in the size of V and not quadratic.
    """

    def __init__(self, config: MambaSplatConfig, *, key: Key[Array, ""]):
        keys = jax.random.split(key, 5)
        c, init = config.channels, weight_init(config)
        self.published = config.variant == "published"
        self.linear_0 = VNLinear(2 * c, c, key=keys[0], init=init) if self.published else None
        self.rectify_0 = VNRectifier(c if self.published else 2 * c, c, key=keys[1], init=init, slope=FRAME_SLOPE)
        self.linear_1 = VNLinear(c, c, key=keys[2], init=init) if self.published else None
        self.rectify_1 = VNRectifier(c, c, key=keys[3], init=init, slope=FRAME_SLOPE)
        self.linear_2 = VNLinear(c, 3, key=keys[4], init=init)

    def __call__(self, vectors: Float[Array, "*batch 3 channel"]) -> Float[Array, "*batch 3 3"]:
        """The frame's vectors as columns; zero where all vectors are."""
        mean = jnp.broadcast_to(vectors.mean(axis=-1, keepdims=True), vectors.shape)
        x = jnp.concatenate([vectors, mean], axis=-1)
        x = self.rectify_0(x if self.linear_0 is None else self.linear_0(x))
        x = self.linear_2(self.rectify_1(x if self.linear_1 is None else self.linear_1(x)))
        if self.published:
            return x
        square = jnp.sum(x * x, axis=(-2, -1), keepdims=True) / 3
        return x * jax.lax.rsqrt(square + 1e-4)


def gram_invariants(vectors: Float[Array, "3 channel"]) -> Float[Array, "pair"]:
    """Inner products of all channel pairs c ≤ d."""
    rows, columns = jnp.triu_indices(vectors.shape[1])
    return (vectors.T @ vectors)[rows, columns]


def length_invariants(vectors: Float[Array, "3 channel"]) -> Float[Array, "channel"]:
    """Length of each channel's vector; the gradient at zero is zero."""
    return _root(jnp.sum(vectors * vectors, axis=0))


def distance_invariants(vectors: Float[Array, "3 channel"]) -> Float[Array, "pair"]:
    """Distance between the vectors of all channel pairs c < d."""
    rows, columns = jnp.triu_indices(vectors.shape[1], k=1)
    return _root(jnp.sum((vectors[:, rows] - vectors[:, columns]) ** 2, axis=0))


def _root(square: Float[Array, "n"]) -> Float[Array, "n"]:
    return jnp.where(square > 0, jnp.sqrt(jnp.where(square > 0, square, 1.0)), 0.0)


def principal_invariants(vectors: Float[Array, "3 channel"]) -> Float[Array, "channel 3"]:
    """Coordinates of the vectors in the eigenframe of VVᵀ, axes by descending eigenvalue.

    An axis' sign is that of the third moment Σ_c (v_c·e)³, which turns with the axis; both jump for symmetric sets. No
    gradient flows through the frame, whose derivative is infinite where eigenvalues meet.
    """
    fixed = jax.lax.stop_gradient(vectors)
    axes = jnp.linalg.eigh(fixed @ fixed.T)[1][:, ::-1]
    skewness = jnp.sum((fixed.T @ axes) ** 3, axis=0)
    return vectors.T @ (axes * jnp.where(skewness < 0, -1.0, 1.0).astype(axes.dtype)[None])


class TokenInvariants(nnx.Module):
    """Invariants of every token, then pooled: mean and maximum survive symmetries that cancel pooled vectors.

    A token's k-th invariant is ⟨A_k v, B_k [v, v̄]⟩ with its own vectors v and the frame's pooled vectors v̄; a small MLP
    reads these beside the scalar slots.
    """

    def __init__(self, config: MambaSplatConfig, *, key: Key[Array, ""]):
        left, right, mlp = jax.random.split(key, 3)
        self.left = VNLinear(config.channels, config.token_invariants, key=left)
        self.right = VNLinear(2 * config.channels, config.token_invariants, key=right)
        width = config.token_invariants + config.scalar_slots * config.channels
        self.mlp = Linear(width, config.token_features, key=mlp)

    def __call__(
        self,
        tokens: Float[Array, "token slot channel"],
        pooled: Float[Array, "slot channel"],
        mask: Bool[Array, "token"],
    ) -> Float[Array, "feature"]:
        """Mean and maximum over the valid tokens; zero where there is none."""
        vectors = tokens[:, :3]
        frame = jnp.broadcast_to(pooled[:3], vectors.shape)
        right = self.right(jnp.concatenate([vectors, frame], axis=-1))
        products = jnp.einsum("nsk,nsk->nk", self.left(vectors), right)
        scalars = tokens[:, 3:].reshape(tokens.shape[0], -1)
        features = jax.nn.gelu(self.mlp(jnp.concatenate([products, scalars], axis=-1)))
        return jnp.concatenate([masked_mean(features, mask), masked_max(features, mask)])


def invariant_count(bridge: Bridge, channels: int) -> int:
    """How many invariants a bridge makes of the pooled vectors."""
    pairs = {"l2_norm": channels, "gram": channels * (channels + 1) // 2, "pairwise": channels * (channels - 1) // 2}
    return pairs.get(bridge, 3 * channels)


class InvariantBridge(nnx.Module):
    """Invariants of the pooled features, the pooled scalars and token invariants → Linear → GELU → LayerNorm."""

    def __init__(self, config: MambaSplatConfig, scalar_slots: int, *, key: Key[Array, ""]):
        frame_key, token_key, linear_key = jax.random.split(key, 3)
        self.kind: Bridge = config.bridge
        self.frame = VNFrame(config, key=frame_key) if config.bridge in ("vn_in", "vn_std") else None
        self.tokens = TokenInvariants(config, key=token_key) if config.invariants_before_pooling else None
        width = invariant_count(config.bridge, config.channels) + scalar_slots * config.channels
        width += 2 * config.token_features * config.invariants_before_pooling + frame_extras(config)
        self.linear = Linear(width, config.d_model, key=linear_key)
        self.norm = LayerNorm(config.d_model)

    def invariants(
        self,
        pooled: Float[Array, "slot channel"],
        tokens: Float[Array, "token slot channel"],
        mask: Bool[Array, "token"],
    ) -> Float[Array, "invariant"]:
        """The chosen invariants of the vectors, flattened with the channel major; or their coordinates, the control."""
        vectors = pooled[:3]
        if self.frame is not None and self.kind == "vn_in":
            return (vectors.T @ self.frame(vectors)).reshape(-1)
        if self.frame is not None:
            each = jnp.einsum("nsc,nsk->nck", tokens[:, :3], self.frame(tokens[:, :3]))
            return masked_mean(each, mask).reshape(-1)
        if self.kind == "coordinates":
            return vectors.T.reshape(-1)
        functions = {"l2_norm": length_invariants, "gram": gram_invariants, "pairwise": distance_invariants}
        return functions.get(self.kind, principal_invariants)(vectors).reshape(-1)

    def __call__(
        self,
        pooled: Float[Array, "slot channel"],
        tokens: Float[Array, "token slot channel"],
        mask: Bool[Array, "token"],
        extra: Float[Array, "extra"],
    ) -> Float[Array, "width"]:
        """One frame's descriptor; `extra` holds further invariants of the frame (log radius), often none."""
        parts = [self.invariants(pooled, tokens, mask), pooled[3:].T.reshape(-1)]
        if self.tokens is not None:
            parts.append(self.tokens(tokens, pooled, mask))
        return self.norm(jax.nn.gelu(self.linear(jnp.concatenate([*parts, extra])), approximate=False))
