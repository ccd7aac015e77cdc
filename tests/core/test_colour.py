"""sRGB: known values, both directions, both kinds of arrays, gradients that stay finite."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from aerojax.core.colour import as_bytes, as_floats, linear_from_srgb, srgb_from_linear


@pytest.mark.parametrize(("encoded", "linear"), [(0.0, 0.0), (0.02, 0.02 / 12.92), (0.5, 0.21404114), (1.0, 1.0)])
def test_known_values(encoded, linear):
    np.testing.assert_allclose(linear_from_srgb(np.array([encoded])), [linear], atol=1e-8)
    np.testing.assert_allclose(srgb_from_linear(np.array([linear])), [encoded], atol=1e-8)


def test_jax_gives_what_numpy_gives_and_both_ways_meet():
    values = np.linspace(0.0, 1.0, 257)
    np.testing.assert_allclose(srgb_from_linear(linear_from_srgb(values)), values, atol=1e-7)
    found = linear_from_srgb(jnp.asarray(values, jnp.float32))
    assert isinstance(found, jax.Array)
    np.testing.assert_allclose(found, linear_from_srgb(values), atol=1e-6)


@pytest.mark.parametrize("function", [linear_from_srgb, srgb_from_linear])
def test_gradients_are_finite(function):
    slopes = jax.vmap(jax.grad(lambda x: function(x).sum()))(jnp.array([-0.1, 0.0, 1e-9, 0.0031308, 0.04045, 1.0]))
    assert bool(jnp.isfinite(slopes).all()) and float(slopes[1]) > 0


def test_images_come_back_from_bytes_and_are_cut_to_what_bytes_hold():
    every = np.arange(256, dtype=np.uint8).reshape(16, 16, 1).repeat(3, axis=2)
    np.testing.assert_array_equal(as_bytes(as_floats(every)), every)
    beyond = np.array([-0.5, 0.0, 1.5], np.float32).reshape(1, 1, 3)
    np.testing.assert_array_equal(as_bytes(beyond), [[[0, 0, 255]]])
