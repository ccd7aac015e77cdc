"""Triangulation by hand-computed numbers."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np

from aerojax.geometry.triangulation import intersect_rays

HALF = np.sqrt(0.5)


def test_triangulation_by_hand():
    origins = jnp.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [5.0, 5.0, 5.0]])
    directions = jnp.array([[HALF, HALF, 0.0], [-HALF, HALF, 0.0], [0.0, 0.0, 1.0]])
    weights = jnp.array([1.0, 1.0, 0.0])
    np.testing.assert_allclose(intersect_rays(origins, directions, weights), [1.0, 1.0, 0.0], atol=1e-5)
    assert float(jnp.linalg.norm(intersect_rays(origins, directions) - jnp.array([1.0, 1.0, 0.0]))) > 0.5


def test_skew_lines_meet_half_way():
    origins = jnp.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    directions = jnp.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    np.testing.assert_allclose(intersect_rays(origins, directions), [0.0, 0.0, 0.5], atol=1e-6)
