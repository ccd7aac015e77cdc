"""Parameters of the baselines, and operations of one forward pass as the thesis counts them.

Two operations for each multiply-add of a matrix product or of a convolution that is one: what PyTorch's counter sees of
the released modules, whose scans and depthwise convolutions are fused kernels that it does not look into.
"""

from __future__ import annotations

import math

import jax

from aerojax.classify.base import ClassifierConfig, untrained
from aerojax.classify.baselines.config import (
    MAMBA4D_SIZES,
    TRANSFORMER_SIZES,
    VECTOR_SIZES,
    Mamba4DConfig,
    P4TransformerConfig,
    TubeSizes,
    VectorSizes,
    VNDGCNNConfig,
    VNPointNetConfig,
)
from aerojax.classify.baselines.tubes import OFFSETS, anchor_frames
from aerojax.classify.mambasplat.config import MambaSplatConfig
from aerojax.core import tensors

BaselineConfig = VNPointNetConfig | VNDGCNNConfig | P4TransformerConfig | Mamba4DConfig


def parameter_count(config: ClassifierConfig) -> int:
    """Numbers that training optimises, of any member."""
    shapes = jax.eval_shape(lambda key: untrained(config, tokens=1, frames=1, key=key).network, jax.random.key(0))
    return tensors.parameter_count(shapes)


def unread_parameters(config: BaselineConfig) -> int:
    """Size of a linear map that Mamba4D's released code stores, counts in its total and never calls."""
    return 4 * MAMBA4D_SIZES[config.size].width if isinstance(config, Mamba4DConfig) else 0


def operations(config: BaselineConfig, frames: int, tokens: int) -> int:
    """Floating-point operations of one clip.

    Args:
        config: of any baseline.
        frames: frames of the clip.
        tokens: Gaussians of a frame.
    """
    match config:
        case VNPointNetConfig():
            return 2 * frames * _vn_pointnet(VECTOR_SIZES[config.size], config.classes, tokens)
        case VNDGCNNConfig():
            return 2 * frames * _vn_dgcnn(VECTOR_SIZES[config.size], config.classes, tokens)
        case P4TransformerConfig():
            return 2 * _p4transformer(config, frames, tokens)
        case Mamba4DConfig():
            return 2 * _mamba4d(config, frames, tokens)


def _vn_pointnet(sizes: VectorSizes, classes: int, tokens: int) -> int:
    """Multiply-adds of one frame; layers that rectify have two maps."""
    one, two, four, eight, sixteen = sizes.channels
    near = min(sizes.neighbours, tokens)
    by_token = near * 2 * 3 * one + 2 * one * one  # neighbours, first
    by_token += 2 * (one * one + one * two + two * sixteen)  # transform
    by_token += 2 * 2 * one * two + two * sixteen  # second, third
    by_frame = 2 * (sixteen * eight + eight * four) + four * one
    vectors = 3 * (tokens * by_token + by_frame) + 3 * tokens * tokens
    return vectors + _std_feature(2 * sixteen, tokens) + _head(6 * sixteen, sizes, classes)


def _vn_dgcnn(sizes: VectorSizes, classes: int, tokens: int) -> int:
    one, two, four, _, sixteen = sizes.channels
    near, joint = min(sizes.neighbours, tokens), 2 * one + two + four
    edges = ((1, one), (one, one), (one, two), (two, four))
    by_token = sum(near * 2 * 2 * inputs * outputs for inputs, outputs in edges) + joint * (sixteen + 1)
    distances = tokens * tokens * sum(inputs for inputs, _ in edges)
    vectors = 3 * (tokens * by_token + distances)
    return vectors + _std_feature(2 * sixteen, tokens) + _head(12 * sixteen, sizes, classes)


def _std_feature(channels: int, tokens: int) -> int:
    """Two rectified layers, three vectors, and the products with them."""
    half, quarter = channels // 2, channels // 4
    return 3 * tokens * (2 * channels * half + 2 * half * quarter + 3 * quarter + 3 * channels)


def _head(inputs: int, sizes: VectorSizes, classes: int) -> int:
    first, second = sizes.hidden
    return inputs * first + first * second + second * classes


def _tubes(sizes: TubeSizes, frames: int, tokens: int) -> tuple[int, int, int]:
    """Tubes of a clip, their balls, and the points of all balls."""
    number = anchor_frames(frames) * max(1, tokens // sizes.stride)
    return number, number * len(OFFSETS), number * len(OFFSETS) * sizes.neighbours


def _p4transformer(config: P4TransformerConfig, frames: int, tokens: int) -> int:
    sizes = TRANSFORMER_SIZES[config.size]
    width, inner = sizes.width, sizes.heads * sizes.head_width
    number, _, points = _tubes(sizes.tubes, frames, tokens)
    layer = number * (4 * width * inner + 2 * width * sizes.hidden) + 2 * number * number * inner
    head = width * sizes.hidden + sizes.hidden * config.classes
    return (points + number) * 4 * width + sizes.layers * layer + head


def _mamba4d(config: Mamba4DConfig, frames: int, tokens: int) -> int:
    sizes, (one, two, four) = MAMBA4D_SIZES[config.size], MAMBA4D_SIZES[config.size].point
    number, balls, points = _tubes(sizes.tubes, frames, tokens)
    encoder = points * (3 * one + one * two + 2 * two * four + four * sizes.width)
    positions = balls * (4 * sizes.position + sizes.position * sizes.width) + number * 4 * sizes.width
    mixed = balls * sizes.intra + 3 * number * sizes.inter  # the tubes come in three orders
    head = sizes.width * sizes.hidden + sizes.hidden * config.classes
    return encoder + positions + mixed * _mamba_layer(sizes.width) + head


def _mamba_layer(width: int) -> int:
    """Multiply-adds of a Mamba layer's four maps for one token."""
    layer = MambaSplatConfig(d_model=width)
    inner, rank = layer.expand * width, math.ceil(width / 16)
    return 2 * width * inner + inner * (rank + 2 * layer.d_state) + rank * inner + inner * width
