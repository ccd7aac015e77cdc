"""MambaSplat-4D: a clip of Gaussians in, class logits out.

A model is an `flax.nnx.Module` and a pytree whose leaves are its parameters, so the plain transformations apply:

    model = MambaSplat(MambaSplatConfig(), key=jax.random.key(0))
    logits = jax.jit(lambda model, columns, mask: model(columns, mask))(model, columns, mask)

    def loss(model, columns, mask, labels, key):            # columns (batch, time, token, 14)
        keys = jax.random.split(key, labels.shape[0])
        logits = jax.vmap(lambda c, m, k: model(c, m, key=k))(columns, mask, keys)
        return optax.softmax_cross_entropy_with_integer_labels(logits, labels).mean()

    value, gradient = jax.jit(jax.value_and_grad(loss))(model, columns, mask, labels, key)
    updates, state = optimiser.update(gradient, state, model)   # the gradient is a MambaSplat of gradients
    model = optax.apply_updates(model, updates)

No `nnx.jit`, no split and merge. Equal layers are stacked on a leading axis (`encoder.blocks`, `temporal.layers`).
"""

from __future__ import annotations

from dataclasses import replace

import jax
import jax.numpy as jnp
from flax import nnx
from jaxtyping import Array, Bool, Float, Key

from aerojax.classify.mambasplat.bridges import InvariantBridge
from aerojax.classify.mambasplat.config import MambaSplatConfig, uses_colour, uses_opacity
from aerojax.classify.mambasplat.encoder import LARGE_FRAME, VNEncoder, masked_mean, weight_init
from aerojax.classify.mambasplat.layers import Linear, drop
from aerojax.classify.mambasplat.lifting import (
    ExactLifting,
    Frames,
    PublishedLifting,
    ScaleSums,
    normalise_after,
    normalise_clip,
)
from aerojax.classify.mambasplat.mamba import MambaStack, MambaState, sinusoids
from aerojax.classify.mambasplat.motion import MotionState, feature_count, motion_state
from aerojax.classify.mambasplat.vector_neurons import VNLinear
from aerojax.core.types import pytree_dataclass
from aerojax.gaussians.merge import merge_moments


@pytree_dataclass
class StreamState:
    """What the model remembers of a stream.

    temporal: the state of the Mamba layers, if the model has any.
    scale: sums of the running radius.
    motion: the frames before, if the configuration has features that compare with them.
    total: sum of the frame embeddings so far.
    count: number of valid frames so far.
    embedding: the last valid frame's embedding.
    """

    temporal: MambaState | None
    scale: ScaleSums
    motion: MotionState | None
    total: Float[Array, "width"]
    count: Float[Array, ""]
    embedding: Float[Array, "width"]


class ClassifierHead(nnx.Module):
    """Linear → ReLU → dropout → linear."""

    def __init__(self, config: MambaSplatConfig, *, key: Key[Array, ""]):
        hidden, out = jax.random.split(key)
        self.hidden = Linear(config.d_model, config.d_model // 2, key=hidden)
        self.out = Linear(config.d_model // 2, config.classes, key=out)
        self.rate = config.head_dropout

    def __call__(self, z: Float[Array, "width"], *, key: Key[Array, ""] | None = None) -> Float[Array, "label"]:
        """Logits of one clip."""
        return self.out(drop(jax.nn.relu(self.hidden(z)), self.rate, key=key))


class MambaSplat(nnx.Module):
    """The classifier; see the module's docstring for how to transform it."""

    def __init__(self, config: MambaSplatConfig, *, key: Key[Array, ""]):
        lift, encoder, pool, bridge, temporal, head = jax.random.split(key, 6)
        self.config = config
        published = config.variant == "published"
        self.lifting = (PublishedLifting if published else ExactLifting)(config, key=lift)
        self.encoder = VNEncoder(config, key=encoder)
        self.pool = VNLinear(config.channels, config.channels, key=pool, init=weight_init(config))
        scalars = uses_opacity(config.mode) + 3 * uses_colour(config.mode) if published else config.scalar_slots
        self.bridge = InvariantBridge(config, scalars, key=bridge)
        self.temporal = MambaStack(config, key=temporal) if config.temporal == "mamba" else None
        self.head = ClassifierHead(config, key=head)

    def __call__(
        self,
        columns: Float[Array, "time token 14"],
        mask: Bool[Array, "time token"],
        *,
        key: Key[Array, ""] | None = None,
    ) -> Float[Array, "label"]:
        """Classify one clip.

        Args:
            columns: exact variant: metric world Gaussians, normalised here; published variant: frames as the released
                code prepares them. Padded rows may hold anything in the exact variant.
            mask: valid tokens. In the exact variant a frame without any is as if it had not been recorded; the
                published one counts it.
            key: turns on dropout.

        Returns:
            Logits. The exact variant's do not change when all Gaussians are rotated or moved together.
        """
        time_key, head_key = (None, None) if key is None else jax.random.split(key)
        features, valid = self.frame_features(columns, mask)
        return self.head(self.embed(features, valid, key=time_key), key=head_key)

    def frame_features(
        self, columns: Float[Array, "time token 14"], mask: Bool[Array, "time token"]
    ) -> tuple[Float[Array, "time width"], Bool[Array, "time"]]:
        """Each frame's invariant descriptor, and which frames count."""
        if self.config.variant == "published":
            no_extra = jnp.zeros((columns.shape[0], 0), columns.dtype)
            return self._describe_all(columns, mask, no_extra), jnp.ones(columns.shape[0], bool)
        frames = normalise_clip(columns, mask, self.config)
        if self.config.merged_tokens:
            return self._describe_merged(columns, mask, frames), mask.any(axis=1)
        return self._describe_all(frames.columns, mask, frames.extra), mask.any(axis=1)

    def _describe_all(self, columns: Array, mask: Array, extra: Array) -> Float[Array, "time width"]:
        # Many small frames are one large product each; a large frame alone fills the machine, and its cache.
        if columns.shape[1] <= LARGE_FRAME:
            return jax.vmap(self.describe)(columns, mask, extra)
        return jax.lax.map(lambda frame: self.describe(*frame), (columns, mask, extra))

    def describe(
        self, columns: Float[Array, "token 14"], mask: Bool[Array, "token"], extra: Float[Array, "extra"]
    ) -> Float[Array, "width"]:
        """The invariant descriptor of one normalised frame, whose tokens are not merged."""
        return self._read(self.lifting(columns, mask), mask, extra)

    def _describe_merged(self, columns: Array, mask: Array, frames: Frames) -> Float[Array, "time width"]:
        """Descriptors of frames whose tokens are merged as they are in space, and then normalised.

        What belongs to which cluster hangs on small distances between tokens, so nothing may round their places first.
        """
        config = self.config
        assert isinstance(self.lifting, ExactLifting)
        lifting = self.lifting

        def lift(frame: tuple[Array, ...]) -> tuple[Array, Array]:
            columns, mask, centre, radius = frame
            merged = merge_moments(
                columns, mask, config.merged_tokens, lloyd=config.merge_steps, seeds=config.merge_seeds, origin=centre
            )
            mean, covariance = merged.mean / radius, merged.covariance / radius**2
            # Nothing in front of the lifting learns.
            merged = jax.lax.stop_gradient(replace(merged, mean=mean, covariance=covariance))
            return lifting.merged(merged), merged.mask

        # One frame after the other: its table of tokens and clusters stays in a cache.
        lifted, mask = jax.lax.map(lift, (columns, mask, frames.centre, frames.radius))
        return jax.vmap(self._read)(lifted, mask, frames.extra)

    def _read(self, lifted: Array, mask: Array, extra: Array) -> Float[Array, "width"]:
        tokens = self.encoder(lifted, mask)
        return self.bridge(self.pool(masked_mean(tokens, mask)), tokens, mask, extra)

    def embed(
        self, features: Float[Array, "time width"], valid: Bool[Array, "time"], *, key: Key[Array, ""] | None = None
    ) -> Float[Array, "width"]:
        """Encode descriptors over time and read out one embedding; frames that are not valid leave no trace."""
        features, valid = self._encode(features, valid, key)
        if self.config.readout == "mean":
            return masked_mean(features, valid)
        last = jnp.max(jnp.where(valid, jnp.arange(valid.shape[0]), 0))
        return jnp.where(valid.any(), features[last], 0.0)

    def _encode(self, features: Array, valid: Array, key: Array | None) -> tuple[Array, Array]:
        """Encoded descriptors with the valid ones first: the layers are causal, so no other one reaches those."""
        position_key, layer_key = (None, None) if key is None else jax.random.split(key)
        if self.config.positional_encoding:
            features = features + sinusoids(*features.shape).astype(features.dtype)
        order = jnp.argsort(~valid, stable=True)
        features, valid = features[order], valid[order]
        if self.temporal is not None:
            features = drop(features, self.config.dropout, key=position_key)
            features = self.temporal(features, key=layer_key)
        return features, valid

    def prefixes(
        self, columns: Float[Array, "time token 14"], mask: Bool[Array, "time token"]
    ) -> Float[Array, "time label"]:
        """Logits after each frame, all from one pass over the clip, whose scale they share."""
        return jax.vmap(self.head)(self.readouts(columns, mask)[0])

    def readouts(
        self,
        columns: Float[Array, "time token 14"],
        mask: Bool[Array, "time token"],
        *,
        key: Key[Array, ""] | None = None,
    ) -> tuple[Float[Array, "time width"], Bool[Array, "time"]]:
        """What the head reads after each frame, zero before the first that counts, and whether there was one.

        What is read out after t frames is the mean, or the last, of the encoded valid frames up to t, and the encoder
        is causal: nothing is computed twice.
        """
        features, valid = self.frame_features(columns, mask)
        encoded, first = self._encode(features, valid, key)
        if self.config.readout == "mean":
            weights = first.astype(encoded.dtype)[:, None]
            encoded = jnp.cumsum(encoded * weights, axis=0) / jnp.maximum(jnp.cumsum(weights, axis=0), 1.0)
        count = jnp.cumsum(valid)
        read = jnp.where(count[:, None] > 0, encoded[jnp.maximum(count - 1, 0)], jnp.zeros((), encoded.dtype))
        return read, count > 0

    def initial_state(self) -> StreamState:
        """The state of a stream before its first frame."""
        kind = jax.tree.leaves(self)[0].dtype
        zero, none = jnp.zeros(self.config.d_model, kind), jnp.zeros((), kind)
        temporal = self.temporal.initial_state() if self.temporal is not None else None
        motion = motion_state(kind) if feature_count(self.config) else None
        return StreamState(temporal, ScaleSums(none, none), motion, zero, none, zero)

    def step(
        self, columns: Float[Array, "token 14"], mask: Bool[Array, "token"], state: StreamState
    ) -> tuple[Float[Array, "label"], StreamState]:
        """Logits after one more frame of a stream; equal to those of all frames so far as one clip.

        Args:
            columns: a frame, as the call wants them, of a model whose configuration does not look ahead.
            mask: valid tokens; a frame without any leaves the state as it was.
            state: from `initial_state` or the last step.
        """
        read, state = self.advance(columns, mask, state)
        return self.head(read), state

    def advance(
        self, columns: Float[Array, "token 14"], mask: Bool[Array, "token"], state: StreamState
    ) -> tuple[Float[Array, "width"], StreamState]:
        """What the head reads after one more frame; as `step`."""
        frame, temporal = (columns[None], mask[None]), state.temporal
        frames, scale, motion = normalise_after(state.scale, state.motion, *frame, self.config)
        if self.config.merged_tokens:
            embedding = self._describe_merged(*frame, frames)[0]
        else:
            embedding = self.describe(frames.columns[0], mask, frames.extra[0])
        if self.temporal is not None and temporal is not None:
            embedding, temporal = self.temporal.step(embedding, temporal)
        following = StreamState(temporal, scale, motion, state.total + embedding, state.count + 1, embedding)
        following = jax.tree.map(lambda new, old: jnp.where(mask.any(), new, old), following, state)
        mean = following.total / jnp.maximum(following.count, 1.0)
        return mean if self.config.readout == "mean" else following.embedding, following
