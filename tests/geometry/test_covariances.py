"""Covariances by hand-computed numbers."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np

from aerojax.geometry.covariances import axes_from_covariance, covariance_from_axes

HALF = np.sqrt(0.5)


def test_covariance_by_hand():
    sigma = covariance_from_axes(jnp.array([HALF, 0.0, 0.0, HALF]), jnp.array([2.0, 1.0, 0.5]))
    np.testing.assert_allclose(sigma, np.diag([1.0, 4.0, 0.25]), atol=1e-6)
    _, scale = axes_from_covariance(jnp.diag(jnp.array([1.0, 4.0, 0.25])))
    np.testing.assert_allclose(scale, [2.0, 1.0, 0.5], rtol=1e-6)


def test_rounding_below_zero_becomes_a_flat_axis():
    _, scale = axes_from_covariance(jnp.diag(jnp.array([1.0, 0.25, -1e-9])))
    np.testing.assert_allclose(scale, [1.0, 0.5, 0.0], atol=1e-6)
