"""Photometric losses against hand-computed numbers and scikit-image's formula; the fit recovers what it is shown."""

from __future__ import annotations

import dataclasses

import jax.numpy as jnp
import numpy as np
from scipy.ndimage import gaussian_filter
from splat_scenes import drawing, make_gaussians

from aerojax.geometry.cameras import look_at
from aerojax.reconstruct.fit import GaussianFitConfig, fit_gaussians
from aerojax.reconstruct.photometric import (
    backdrop_colour,
    certain_pixels,
    foreground_psnr,
    over_backdrop,
    photometric_loss,
    structural_similarity,
)
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


def test_the_backdrop_replaces_clutter_but_not_the_rim():
    """A block on an even backdrop with a bright spot far from it: the spot goes, block and rim stay."""
    mask = jnp.zeros((1, 20, 20)).at[0, 8:12, 8:12].set(1.0)
    rgb = jnp.full((1, 20, 20, 3), 0.25).at[0, 7:13, 7:13].set(0.75)
    backdrop = backdrop_colour(rgb, mask)
    np.testing.assert_allclose(backdrop, 0.25, rtol=1e-6)
    clean = over_backdrop(rgb.at[0, 2, 2].set(1.0), mask, backdrop)
    np.testing.assert_allclose(clean, rgb, rtol=1e-6)
    np.testing.assert_allclose(backdrop_colour(rgb, jnp.ones_like(mask)), 1.0)


def test_fit_recovers_colour_and_shape():
    """Views of known Gaussians over a backdrop; from grey, half transparent ones in the right places."""
    truth = make_gaussians(0, 24, 1, np.float32, opacity=(0.95, 0.99), sigma=(0.06, 0.12))
    poses = [look_at(jnp.array(c), jnp.zeros(3)) for c in ((2.0, 0, 0.3), (0, 2.0, -0.3), (-1.4, -1.4, 0.2))]
    K = jnp.array([[30.0, 0, 12], [0, 30.0, 12], [0, 0, 1]])
    camera = Camera(jnp.stack([K] * 3), jnp.stack(poses), 24, 24)
    backdrop = jnp.array([0.1, 0.2, 0.3])
    draw = drawing(antialias=True)
    image = draw(truth, camera, background=backdrop)
    views = View(image.colour, (image.alpha > 0.5).astype(jnp.float32), camera)
    start = dataclasses.replace(truth, sh=jnp.zeros_like(truth.sh), opacity=jnp.full(24, 0.5))
    losses = []
    config = GaussianFitConfig(steps=60, report_every=30, colour_rate=0.05, opacity_rate=0.1, mask_weight=0.1)
    fitted = fit_gaussians(start, views, config=config, report=lambda done, loss: losses.append((done, loss)))
    before, after = (draw(g, camera, background=backdrop).colour for g in (start, fitted))
    scores = [float(foreground_psnr(x, image.colour, views.mask)) for x in (before, after)]
    assert [done for done, _ in losses] == [30, 60] and losses[-1][1] < losses[0][1]
    assert scores[1] > 22 and scores[1] > scores[0] + 6, scores
    np.testing.assert_allclose(jnp.linalg.norm(fitted.quaternion, axis=-1), 1.0, rtol=1e-5)
