"""Parameters, and operations of one forward pass counted as the thesis counts them."""

from __future__ import annotations

import dataclasses
import math

import jax

from aerojax.classify.mambasplat.bridges import InvariantBridge, invariant_count
from aerojax.classify.mambasplat.config import MambaSplatConfig, frame_extras, uses_colour, uses_opacity, uses_shape
from aerojax.classify.mambasplat.encoder import FEED_FORWARD_FACTOR
from aerojax.classify.mambasplat.model import MambaSplat
from aerojax.core import tensors
from aerojax.core.errors import UserError


def published_operations(config: MambaSplatConfig, frames: int, tokens: int) -> int:
    """Floating-point operations of one clip: two for each multiply-add of a matrix product.

    This is what PyTorch's counter sees of the released modules with the reference scan: matrix products, the depthwise
    convolution with the outputs of its padding, and the read-out C·s of the scan's state; not norms, activations,
    softmax or the recurrence. A lift of one vector multiplies without a sum and is therefore not seen.

    Args:
        config: the published variant with its VN-In bridge and Mamba layers.
        frames: frames of the clip.
        tokens: Gaussians of a frame.

    Raises:
        UserError: for another variant, bridge or temporal model, which this formula does not describe.
    """
    if (config.variant, config.bridge, config.temporal) != ("published", "vn_in", "mamba"):
        raise UserError(
            "invalid",
            "operations are counted for variant 'published', bridge 'vn_in' and temporal 'mamba' only",
            "choose such a model",
        )
    c, d, attended = config.channels, config.d_model, config.heads * config.head_dim
    wide, slots = FEED_FORWARD_FACTOR * c, 3 + uses_opacity(config.mode) + 3 * uses_colour(config.mode)
    lift = tokens * 4 * c * 3 if uses_shape(config.mode) else 0
    block = tokens * (4 * c * attended + 2 * c * wide + 2 * wide * wide) * slots + 2 * tokens**2 * attended * slots
    frame_mlp = 2 * c * c + 2 * c * c + c * c + 2 * c * c + 3 * c
    bridge = 3 * frame_mlp + 9 * c + c * slots * d
    frame = lift + config.depth * block + c * c * slots + bridge
    return 2 * (frames * frame + _temporal(config, frames) + d * d // 2 + d // 2 * config.classes)


def operations(config: MambaSplatConfig, frames: int, tokens: int) -> int:
    """Floating-point operations of one clip of either variant, by the convention of `published_operations`.

    The exact variant's lift counts its matrix products too, those of 3x3 covariances included; eigenvectors of the
    bridge `pca_frame` and the merging of tokens in front of the network do not count.

    Raises:
        UserError: for a published model with another bridge or temporal model than the released one.
    """
    if config.variant == "published":
        return published_operations(config, frames, tokens)
    tokens = config.merged_tokens or tokens
    c, slots = config.channels, 3 + config.scalar_slots
    attended, wide = config.heads * config.head_dim, FEED_FORWARD_FACTOR * c
    block = tokens * (4 * c * attended + 3 * c * wide) * slots + 2 * tokens**2 * attended * slots
    frame = _exact_lift(config, tokens) + config.depth * block + c * c * slots + _exact_bridge(config, tokens)
    temporal = _temporal(config, frames) if config.temporal == "mamba" else 0
    return 2 * (
        frames * frame + temporal + config.d_model * (config.d_model // 2) + config.d_model // 2 * config.classes
    )


def _exact_lift(config: MambaSplatConfig, tokens: int) -> int:
    """Multiply-adds of one frame's lift: covariances (27) and their two products with the position (18), two maps."""
    shape, covariance = uses_shape(config.mode), config.lifting == "covariance"
    vectors = 1 if not shape else 3 if covariance else 4
    invariants = 1 + uses_opacity(config.mode) + 3 * uses_colour(config.mode) + 3 * (shape and covariance)
    invariants += config.merged_tokens > 0
    # Merged Gaussians come with their covariances.
    products = (18 if config.merged_tokens else 45) * (shape and covariance)
    return tokens * (products + 3 * vectors * config.channels + invariants * config.scalar_slots * config.channels)


def _exact_bridge(config: MambaSplatConfig, tokens: int) -> int:
    """Multiply-adds of one frame's invariants and their projection."""
    c, k = config.channels, config.token_invariants
    frame_mlp = 3 * (4 * c * c + 2 * c * c + 3 * c)
    kinds = {"vn_in": frame_mlp + 9 * c, "vn_std": tokens * (frame_mlp + 9 * c), "gram": 3 * c * c, "pca_frame": 27 * c}
    each = 9 * c * k + (k + config.scalar_slots * c) * config.token_features
    width = invariant_count(config.bridge, c) + config.scalar_slots * c + frame_extras(config)
    before = config.invariants_before_pooling
    width += 2 * config.token_features * before
    return kinds.get(config.bridge, 0) + tokens * each * before + width * config.d_model


def _temporal(config: MambaSplatConfig, frames: int) -> int:
    """Multiply-adds of the Mamba layers: projections, the convolution with its padding's outputs, the read-out."""
    d, inner, rank = config.d_model, config.expand * config.d_model, math.ceil(config.d_model / 16)
    layer = d * 2 * inner + inner * (rank + 2 * config.d_state) + rank * inner + inner * d
    convolution, scan = (frames + config.d_conv - 1) * inner * config.d_conv, frames * inner * config.d_state
    return config.mamba_layers * (frames * layer + convolution + scan)


def parameter_count(config: MambaSplatConfig) -> int:
    """Numbers that training changes."""
    shapes = jax.eval_shape(lambda key: MambaSplat(config, key=key), jax.random.key(0))
    return tensors.parameter_count(shapes)


def unused_bridge_parameters(config: MambaSplatConfig) -> int:
    """Size of the released code's second bridge: always 256 wide, stored and printed with the model, never called."""
    if config.variant != "published":
        return 0
    second, slots = dataclasses.replace(config, d_model=256), uses_opacity(config.mode) + 3 * uses_colour(config.mode)
    shapes = jax.eval_shape(lambda key: InvariantBridge(second, slots, key=key), jax.random.key(0))
    return tensors.parameter_count(shapes)
