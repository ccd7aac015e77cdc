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

    texels: sRGB bytes. linear: linear light of each of the 256 bytes.
    start: first byte of a level. size: width and height of a level.
    first: first level of a texture. count: its levels, finest first.
    """

    texels: np.ndarray
    linear: np.ndarray
    start: np.ndarray
    size: np.ndarray
    first: np.ndarray
    count: np.ndarray


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
