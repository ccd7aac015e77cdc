"""Texture pyramids against hand-computed levels."""

from __future__ import annotations

import numpy as np
import pytest

from aerojax.core.colour import linear_from_srgb
from aerojax.simulate.render.textures import build_pyramids


def test_levels_are_means_in_linear_light():
    checker = np.zeros((4, 5, 3), np.uint8)
    checker[::2, ::2], checker[1::2, 1::2] = 255, 255
    plain = np.full((1, 1, 3), 7, np.uint8)
    found = build_pyramids((checker, plain))
    assert found.first.tolist() == [0, 3] and found.count.tolist() == [3, 1]
    assert found.size.tolist() == [[5, 4], [2, 2], [1, 1], [1, 1]]  # the odd fifth column is left out
    assert found.start.tolist() == [0, 60, 72, 75]
    # Half of full light is 0.735 in sRGB: 188 of 255, and not 128.
    assert set(found.texels[60:75].tolist()) == {188} and found.texels[75:].tolist() == [7, 7, 7]


def test_the_table_decodes_every_byte():
    linear = build_pyramids(()).linear
    assert linear == pytest.approx(linear_from_srgb(np.arange(256) / 255.0), rel=1e-6)
    assert linear[[0, 255]].tolist() == [0.0, 1.0]
