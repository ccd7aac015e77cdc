"""The photometric loss by hand, and images over an even background."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np

from aerojax.reconstruct.fit.photometric import background_colour, over_even_background, photometric_loss


def test_losses_by_hand():
    """Constant images 0.5 and 0.75: L1 = 0.25, SSIM = (2·0.375 + C1)/(0.8125 + C1)."""
    a, b = jnp.full((16, 16, 3), 0.5), jnp.full((16, 16, 3), 0.75)
    ssim = (0.75 + 1e-4) / (0.8125 + 1e-4)
    np.testing.assert_allclose(photometric_loss(a, b), 0.8 * 0.25 + 0.2 * (1 - ssim), rtol=1e-4)
    np.testing.assert_allclose(photometric_loss(a, a), 0.0, atol=1e-6)


def test_the_background_replaces_clutter_but_not_the_boundary():
    """A block on an even background with a bright spot far from it: the spot goes, block and boundary stay."""
    mask = jnp.zeros((1, 20, 20)).at[0, 8:12, 8:12].set(1.0)
    rgb = jnp.full((1, 20, 20, 3), 0.25).at[0, 7:13, 7:13].set(0.75)
    background = background_colour(rgb, mask)
    np.testing.assert_allclose(background, 0.25, rtol=1e-6)
    clean = over_even_background(rgb.at[0, 2, 2].set(1.0), mask, background)
    np.testing.assert_allclose(clean, rgb, rtol=1e-6)
    np.testing.assert_allclose(background_colour(rgb, jnp.ones_like(mask)), 1.0)
