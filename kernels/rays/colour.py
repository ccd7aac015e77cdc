"""sRGB for Warp kernels (IEC 61966-2-1): the same function as `aerojax.core.colour.srgb_from_linear`, on the device."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, no_type_check

import warp as wp


@no_type_check  # Warp compiles it from its source; a run-time checker around it would hide it
@lru_cache(maxsize=1)
def srgb_byte_function() -> Any:
    """The Warp function linear light -> nearest sRGB byte; light is clipped to 0..1."""

    @wp.func
    def _encoded(value: float) -> wp.uint8:
        linear = wp.clamp(value, 0.0, 1.0)
        encoded = 12.92 * linear
        if linear > 0.0031308:
            encoded = 1.055 * wp.pow(linear, 1.0 / 2.4) - 0.055
        return wp.uint8(wp.int32(encoded * 255.0 + 0.5))

    return _encoded
