"""Resampling: inverse depth of a plane is exact at every pixel, and how upstream's stretching differs."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

from aerojax.reconstruct.depthsplat.grids import repeat, resize, resize_areas, resize_patches, resize_positions


def ramp(places):
    """A linear function of the place in the image, by rows and columns."""
    return jnp.asarray(2.0 + 0.5 * places[:, None] - 0.25 * places[None], jnp.float32)[None, :, :, None]


def test_cells_begin_on_the_first_pixel():
    whole = resize(ramp(4 * np.arange(8) + 0.5), 32, compat=False)
    exact = ramp(np.arange(32) + 0.5)
    np.testing.assert_allclose(whole[:, :29, :29], exact[:, :29, :29], atol=1e-5)
    assert float(jnp.abs(whole - exact)[:, 29:].max()) > 0.4  # nothing lies beyond the last cell's centre


def test_upstream_is_pixels_off():
    whole = resize(ramp(4 * np.arange(8) + 0.5), 32, compat=True)
    off = np.abs(whole - ramp(np.arange(32) + 0.5))[0, :, 0, 0] / 0.5
    assert off.max() == pytest.approx(3.0, abs=1e-4) and off[0] < 1e-5


def test_patches_have_their_centres_amidst_them():
    """28 pixels in two patches of 14: centres at 7 and 21; cells of 4 pixels between them."""
    cells = resize_patches(ramp(np.array([7.0, 21.0])), 7, size=28, compat=False)
    exact = ramp(4 * np.arange(7) + 0.5)
    np.testing.assert_allclose(cells[:, 2:6, 2:6], exact[:, 2:6, 2:6], atol=1e-5)


def test_areas():
    x = resize_areas(ramp(np.arange(32) + 0.5), 28, compat=False)
    exact = ramp((np.arange(28) + 0.5) * 32 / 28)
    np.testing.assert_allclose(x, exact, atol=1e-4)
    corners = resize_areas(ramp(np.arange(32) + 0.5), 28, compat=True)
    np.testing.assert_allclose(corners, ramp(np.linspace(0.5, 31.5, 28)), atol=1e-4)


def test_repeat():
    x = jnp.arange(4.0).reshape(1, 2, 2, 1)
    np.testing.assert_array_equal(repeat(x, 2)[0, :, :, 0], [[0, 0, 1, 1], [0, 0, 1, 1], [2, 2, 3, 3], [2, 2, 3, 3]])


def test_positions():
    table = jnp.asarray(np.random.default_rng(0).normal(size=(5, 5, 2)), jnp.float32)
    assert resize_positions(table, 5) is table
    np.testing.assert_allclose(resize_positions(jnp.ones((5, 5, 1)), 9), 1.0, atol=1e-5)
    line = jnp.broadcast_to(jnp.arange(37.0)[:, None, None], (37, 37, 1))
    # Cubic interpolation with this slope bends a line by a twentieth of a step at most, away from the border.
    expected = (np.arange(9) + 0.5) * 37 / 9.1 - 0.5
    np.testing.assert_allclose(resize_positions(line, 9)[1:-1, 0, 0], expected[1:-1], atol=0.06)
