"""Figures of renderings beside images, by hand."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np

from aerojax.evaluate.images import image_figures


def test_surround_counts_four_pixels_more_and_interior_one_less():
    """Wrong by 0.1 over a 3×3 mask: 20 dB there; nine of 11×11 pixels around it; its centre alone is interior."""
    a = jnp.full((1, 32, 32, 3), 0.5)
    mask = jnp.zeros((1, 32, 32)).at[0, 14:17, 14:17].set(1.0)
    everywhere = image_figures(a + 0.1, a, mask)
    np.testing.assert_allclose(everywhere["surround_psnr_db"], 20.0, rtol=1e-4)
    only = image_figures(a + 0.1 * mask[..., None], a, mask)
    np.testing.assert_allclose(only["foreground_psnr_db"], 20.0, rtol=1e-4)
    np.testing.assert_allclose(only["surround_psnr_db"], 20 + 10 * np.log10(121 / 9), rtol=1e-4)
    boundary = image_figures(a.at[0, 14:17, 14:17].add(0.1).at[0, 15, 15].add(-0.09), a, mask)
    np.testing.assert_allclose(boundary["interior_psnr_db"], 40.0, rtol=1e-3)
    assert only["ssim"] < 1.0
