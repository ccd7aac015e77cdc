"""Bilinear samples against numbers by hand and SciPy."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from scipy.ndimage import map_coordinates

from aerojax.geometry.resampling import sample_bilinear


def test_centres_middles_and_what_lies_beyond_the_border():
    image = jnp.array([[[1.0], [3.0]], [[5.0], [7.0]]])
    points = jnp.array([[0.5, 0.5], [1.0, 0.5], [1.0, 1.0], [1.5, 1.5], [0.0, 0.5], [-9.0, 0.5], [1.0, 50.0]])
    expected = [[1.0], [2.0], [4.0], [7.0], [0.5], [0.0], [0.0]]
    np.testing.assert_allclose(sample_bilinear(image, points), expected, atol=1e-6)


def test_scipy_says_the_same():
    rng = np.random.default_rng(0)
    image = rng.random((9, 7, 2)).astype(np.float32)
    points = rng.uniform(-1, 10, (200, 2)).astype(np.float32)
    rows = [map_coordinates(image[..., c], points[:, ::-1].T - 0.5, order=1, mode="grid-constant") for c in (0, 1)]
    np.testing.assert_allclose(
        sample_bilinear(jnp.asarray(image), jnp.asarray(points)), np.stack(rows, axis=1), atol=1e-5
    )
