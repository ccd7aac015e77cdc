"""Pyramids of an object's textures for the ray caster: each level is the mean of 2×2 texels in linear light."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float32, UInt8

from aerojax.core.colour import linear_from_srgb, srgb_from_linear
from kernels.rays.textures import TexturePyramids

_LINEAR_OF_BYTE = linear_from_srgb(np.arange(256) / 255.0).astype(np.float32)


def build_pyramids(textures: tuple[UInt8[np.ndarray, "_ _ 3"], ...]) -> TexturePyramids:
    """Halve each texture (sRGB bytes) in linear light until a side is one texel."""
    levels, first, count = [], [], []
    for texture in textures:
        first.append(len(levels))
        levels.append(texture)
        linear = _LINEAR_OF_BYTE[texture]
        while min(linear.shape[:2]) > 1:
            linear = _halved(linear)
            levels.append(np.round(srgb_from_linear(linear) * 255.0).astype(np.uint8))
        count.append(len(levels) - first[-1])
    sizes = np.array([(level.shape[1], level.shape[0]) for level in levels] or [(1, 1)], np.int32)
    length = np.array([level.size for level in levels] or [3], np.int64)
    return TexturePyramids(
        texels=np.concatenate([level.ravel() for level in levels]) if levels else np.zeros(3, np.uint8),
        linear=_LINEAR_OF_BYTE,
        start=(np.cumsum(length) - length).astype(np.int32),
        size=sizes,
        first=np.array(first or [0], np.int32),
        count=np.array(count or [1], np.int32),
    )


def _halved(linear: Float32[np.ndarray, "_ _ 3"]) -> Float32[np.ndarray, "_ _ 3"]:
    """Mean of 2×2 texels; an odd last row or column is left out, a side of one texel stays."""
    height, width = max(linear.shape[0] // 2, 1), max(linear.shape[1] // 2, 1)
    rows = linear[: 2 * height].reshape(height, -1, linear.shape[1], 3).mean(axis=1)
    return rows[:, : 2 * width].reshape(height, width, -1, 3).mean(axis=2)
