"""Directions on a spiral are unit, at their heights and even."""

from __future__ import annotations

import numpy as np

from aerojax.geometry.directions import golden_spiral


def test_heights_are_kept_and_directions_are_even():
    height = 1 - (2 * np.arange(400) + 1) / 400
    found = golden_spiral(height)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, atol=1e-12)
    np.testing.assert_array_equal(found[:, 2], height)
    cosines = found @ found.T - 2 * np.eye(400)
    nearest = np.arccos(cosines.max(axis=1))
    assert nearest.min() > 0.75 * nearest.max()  # drawn at random the least would be a hundredth of the largest
    np.testing.assert_allclose(found.mean(axis=0), 0.0, atol=5e-3)
