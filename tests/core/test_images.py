"""Measures of images against hand-computed numbers and SciPy's filter."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from scipy.ndimage import gaussian_filter

from aerojax.core.images import dilate, off_boundary, peak_signal_to_noise, structural_similarity


def test_similarity_is_scipys(x64):
    """The same windowed moments by an independent filter (radius 5), at pixels whose window is inside."""
    rng = np.random.default_rng(0)
    x = rng.uniform(size=(20, 24, 3))
    y = np.clip(x + rng.normal(0, 0.2, x.shape), 0, 1)

    def blur(image):
        return gaussian_filter(image, 1.5, radius=5, axes=(0, 1))[5:-5, 5:-5]

    mx, my = blur(x), blur(y)
    vx, vy, cov = blur(x * x) - mx**2, blur(y * y) - my**2, blur(x * y) - mx * my
    c1, c2 = 1e-4, 9e-4
    expected = ((2 * mx * my + c1) * (2 * cov + c2) / ((mx**2 + my**2 + c1) * (vx + vy + c2))).mean()
    np.testing.assert_allclose(structural_similarity(jnp.asarray(x), jnp.asarray(y)), expected, rtol=1e-10)


def test_images_of_a_batch_are_averaged():
    """Constant images 0.5 and 0.75: (2·0.375 + C1)/(0.8125 + C1); equal images: 1."""
    a, b = jnp.full((16, 12, 3), 0.5), jnp.full((16, 12, 3), 0.75)
    ssim = (0.75 + 1e-4) / (0.8125 + 1e-4)
    similarity = structural_similarity(jnp.stack([a, a]), jnp.stack([a, b]))
    np.testing.assert_allclose(similarity, (1 + ssim) / 2, rtol=1e-4)


def test_noise_counts_inside_the_mask_only():
    """Wrong by 0.1 on the mask and by more elsewhere: 20 dB."""
    a = jnp.full((16, 16, 3), 0.5)
    mask = jnp.zeros((16, 16)).at[3:6].set(1.0)
    wrong = a.at[:3].set(1.0).at[3:6].add(0.1)
    np.testing.assert_allclose(peak_signal_to_noise(wrong, a, mask), 20.0, rtol=1e-4)


def test_boundary_pixels_are_those_beside_the_other_side():
    """A 4×4 block: its inner 2×2 and everything two pixels away are off it."""
    mask = jnp.zeros((10, 10)).at[3:7, 3:7].set(1.0)
    known = np.asarray(off_boundary(mask))
    assert known[4:6, 4:6].all() and not known[3, 3:7].any() and not known[2, 2:8].any() and known[1].all()
    assert known.sum() == 100 - 36 + 4


def test_dilation_reaches_as_far_as_asked():
    grown = np.asarray(dilate(jnp.zeros((1, 9, 9)).at[0, 4, 4].set(0.5), 2))
    assert (grown[0, 2:7, 2:7] == 0.5).all() and grown.sum() == 12.5
