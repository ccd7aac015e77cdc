"""The kernels' sRGB encoder is the library's."""

from __future__ import annotations

from typing import no_type_check

import numpy as np
import warp as wp

from aerojax.core.colour import srgb_from_linear
from kernels.rays.colour import srgb_byte_function


@no_type_check
def _encoded(values: np.ndarray) -> np.ndarray:
    encode = srgb_byte_function()

    @wp.kernel
    def _each(values: wp.array(dtype=float), out: wp.array(dtype=wp.uint8)):
        i = wp.tid()
        out[i] = encode(values[i])

    out = wp.zeros(len(values), dtype=wp.uint8, device="cpu")
    wp.launch(_each, dim=len(values), inputs=[wp.array(values, dtype=float, device="cpu")], outputs=[out], device="cpu")
    return out.numpy()


def test_bytes_are_the_librarys_everywhere():
    values = np.linspace(-0.1, 1.2, 20011, dtype=np.float32)
    exact = 255.0 * srgb_from_linear(values.astype(np.float64).clip(0.0, 1.0))
    clear = np.abs(exact % 1.0 - 0.5) > 1e-3  # of two bytes that are equally near, either is right
    assert clear.mean() > 0.99
    np.testing.assert_array_equal(_encoded(values)[clear], np.round(exact)[clear].astype(np.uint8))
