"""Photometric losses against hand-computed numbers and scikit-image's formula; the fit recovers what it is shown."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from scipy.ndimage import gaussian_filter
from splat_scenes import drawing, make_gaussians

from aerojax.geometry.cameras import look_at
from aerojax.reconstruct.fit import GaussianFitConfig, fit_gaussians
from aerojax.reconstruct.photometric import certain_pixels, foreground_psnr, photometric_loss, structural_similarity
from aerojax.types import Camera, View


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


def test_losses_by_hand():
    """Constant images 0.5 and 0.75: L1 = 0.25, SSIM = (2·0.375 + C1)/(0.8125 + C1); PSNR of 0.1 is 20 dB."""
    a, b = jnp.full((16, 16, 3), 0.5), jnp.full((16, 16, 3), 0.75)
    ssim = (0.75 + 1e-4) / (0.8125 + 1e-4)
    np.testing.assert_allclose(photometric_loss(a, b), 0.8 * 0.25 + 0.2 * (1 - ssim), rtol=1e-4)
    np.testing.assert_allclose(photometric_loss(a, a), 0.0, atol=1e-6)
    mask = jnp.zeros((16, 16)).at[3:6].set(1.0)
    wrong = a.at[:3].set(1.0).at[3:6].add(0.1)
    np.testing.assert_allclose(foreground_psnr(wrong, a, mask), 20.0, rtol=1e-4)


def test_certain_pixels_leave_out_the_rim():
    """A 4×4 block: its inner 2×2 and everything two pixels away are certain."""
    mask = jnp.zeros((10, 10)).at[3:7, 3:7].set(1.0)
    certain = np.asarray(certain_pixels(mask))
    assert certain[4:6, 4:6].all() and not certain[3, 3:7].any() and not certain[2, 2:8].any() and certain[1].all()
    assert certain.sum() == 100 - 36 + 4


def test_fit_recovers_colour_and_transparency():
    """Views of known Gaussians over black; from grey ones in the right places the object is found, not its backdrop."""
    truth = make_gaussians(0, 24, 1, np.float32, opacity=(0.6, 0.95), sigma=(0.06, 0.15))
    poses = [look_at(jnp.array(c), jnp.zeros(3)) for c in ((2.0, 0, 0.3), (0, 2.0, -0.3), (-1.4, -1.4, 0.2))]
    K = jnp.array([[30.0, 0, 12], [0, 30.0, 12], [0, 0, 1]])
    camera = Camera(jnp.stack([K] * 3), jnp.stack(poses), 24, 24)
    draw = drawing(antialias=True)
    image = draw(truth, camera, background=jnp.zeros(3))
    # The images are premultiplied; the fit composes rgb·mask, so divide.
    views = View(image.colour / jnp.maximum(image.alpha, 1e-3)[..., None], image.alpha, camera)
    start = dataclasses.replace(truth, sh=jnp.zeros_like(truth.sh), opacity=jnp.full(24, 0.5))
    losses = []
    config = GaussianFitConfig(steps=60, report_every=30, colour_rate=0.05, opacity_rate=0.1)
    fitted = fit_gaussians(
        start, views, config=config, key=jax.random.key(0), report=lambda done, loss: losses.append((done, loss))
    )
    assert [done for done, _ in losses] == [30, 60] and losses[-1][1] < 0.06
    again = draw(fitted, camera, background=jnp.ones(3))
    expected = draw(truth, camera, background=jnp.ones(3))
    assert float(foreground_psnr(again.colour, expected.colour, jnp.ones_like(expected.alpha))) > 25
    np.testing.assert_allclose(jnp.linalg.norm(fitted.quaternion, axis=-1), 1.0, rtol=1e-5)
