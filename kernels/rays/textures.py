"""Textures of a ray caster: 8-bit sRGB pyramids in one buffer, looked up bilinearly in linear light (NVIDIA Warp)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, no_type_check

import numpy as np
import warp as wp


@dataclass(frozen=True)
class TexturePyramids:
    """Texels of every level of every texture, row by row, and where each level lies.

    texels: sRGB bytes. start: first byte of a level. size: width and height of a level.
    first: first level of a texture. count: its levels, finest first.
    """

    texels: np.ndarray
    start: np.ndarray
    size: np.ndarray
    first: np.ndarray
    count: np.ndarray


@lru_cache(maxsize=1)
def linear_of_byte() -> np.ndarray:
    """Linear light of the 256 sRGB bytes (IEC 61966-2-1)."""
    encoded = np.arange(256) / 255.0
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4).astype(np.float32)


def _halved(linear: np.ndarray) -> np.ndarray:
    """Mean of 2x2 texels; an odd last row or column is left out, a side of one texel stays."""
    height, width = max(linear.shape[0] // 2, 1), max(linear.shape[1] // 2, 1)
    rows = linear[: 2 * height].reshape(height, -1, linear.shape[1], 3).mean(axis=1)
    return rows[:, : 2 * width].reshape(height, width, -1, 3).mean(axis=2)


def _bytes_of_linear(linear: np.ndarray) -> np.ndarray:
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055)
    return np.round(encoded * 255.0).astype(np.uint8)


def build_pyramids(textures: tuple[np.ndarray, ...]) -> TexturePyramids:
    """Halve each texture (height, width, 3; sRGB bytes) in linear light until a side is one texel."""
    levels, first, count = [], [], []
    for texture in textures:
        first.append(len(levels))
        levels.append(texture)
        linear = linear_of_byte()[texture]
        while min(linear.shape[:2]) > 1:
            linear = _halved(linear)
            levels.append(_bytes_of_linear(linear))
        count.append(len(levels) - first[-1])
    sizes = np.array([(level.shape[1], level.shape[0]) for level in levels] or [(1, 1)], np.int32)
    length = np.array([level.size for level in levels] or [3], np.int64)
    texels = np.concatenate([level.ravel() for level in levels]) if levels else np.zeros(3, np.uint8)
    start = (np.cumsum(length) - length).astype(np.int32)
    return TexturePyramids(texels, start, sizes, np.array(first or [0], np.int32), np.array(count or [1], np.int32))


@no_type_check  # Warp compiles these from their source; a run-time checker around them would hide it
@lru_cache(maxsize=1)
def sampling_function() -> Any:
    """The Warp function (texels, linear, start, size, level, uv) -> linear colour: bilinear, repeating, v upwards."""

    @wp.func
    def _texel(texels: wp.array(dtype=wp.uint8), linear: wp.array(dtype=float), at: int) -> wp.vec3:
        return wp.vec3(linear[int(texels[at])], linear[int(texels[at + 1])], linear[int(texels[at + 2])])

    @wp.func
    def _wrapped(index: int, size: int) -> int:
        return ((index % size) + size) % size

    @wp.func
    def _sample(
        texels: wp.array(dtype=wp.uint8),
        linear: wp.array(dtype=float),
        start: wp.array(dtype=int),
        size: wp.array(dtype=wp.vec2i),
        level: int,
        uv: wp.vec2,
    ) -> wp.vec3:
        width = size[level][0]
        height = size[level][1]
        x = (uv[0] - wp.floor(uv[0])) * float(width) - 0.5
        y = (1.0 - (uv[1] - wp.floor(uv[1]))) * float(height) - 0.5
        column = int(wp.floor(x))
        row = int(wp.floor(y))
        right = x - float(column)
        down = y - float(row)
        left_x = _wrapped(column, width)
        right_x = _wrapped(column + 1, width)
        upper = start[level] + 3 * width * _wrapped(row, height)
        lower = start[level] + 3 * width * _wrapped(row + 1, height)
        above = (1.0 - right) * _texel(texels, linear, upper + 3 * left_x)
        above += right * _texel(texels, linear, upper + 3 * right_x)
        below = (1.0 - right) * _texel(texels, linear, lower + 3 * left_x)
        below += right * _texel(texels, linear, lower + 3 * right_x)
        return (1.0 - down) * above + down * below

    return _sample
