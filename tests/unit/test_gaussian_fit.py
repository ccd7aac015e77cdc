"""Photometric losses against hand-computed numbers and scikit-image's formula; the fit recovers what it is shown."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from splat_scenes import drawing, make_gaussians

from aerojax.errors import UserError
from aerojax.geometry.cameras import look_at
from aerojax.reconstruct.fit import GaussianFitConfig, fit_gaussians
from aerojax.reconstruct.matte import apparent_opacity, estimated_opacity
from aerojax.reconstruct.photometric import (
    backdrop_colour,
    certain_pixels,
    foreground_psnr,
    over_backdrop,
    photometric_loss,
    structural_similarity,
    surround_psnr,
)
from aerojax.reconstruct.solid import SolidConfig, solid_gaussians
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


def test_surround_counts_four_pixels_more():
    """Wrong by 0.1 over the 3×3 mask and everywhere beyond it: 20 dB; right beyond it: nine of 11×11 pixels err."""
    a = jnp.full((1, 32, 32, 3), 0.5)
    mask = jnp.zeros((1, 32, 32)).at[0, 14:17, 14:17].set(1.0)
    np.testing.assert_allclose(surround_psnr(a + 0.1, a, mask), 20.0, rtol=1e-4)
    only = a + 0.1 * mask[..., None]
    np.testing.assert_allclose(surround_psnr(only, a, mask), 20 + 10 * np.log10(121 / 9), rtol=1e-4)


def test_apparent_opacity_undoes_the_blend_of_light():
    """A black object that covers half a white pixel: light 0.5 is shown as sRGB 0.7354, so a = 0.2646."""
    shown = jnp.array([0.0, 0.7354, 1.0])[None, :, None] * jnp.ones(3)
    coverage = jnp.array([[1.0, 0.5, 0.0]])
    opacity = apparent_opacity(shown, coverage, jnp.ones_like(shown))
    # The prior of weight 0.01 pulls towards the coverage: (3·0.2646 + 0.01·0.5)/3.01.
    np.testing.assert_allclose(opacity, [[1.0, (3 * 0.2646 + 0.005) / 3.01, 0.0]], atol=1e-3)
    invisible = apparent_opacity(jnp.ones((1, 1, 3)), jnp.array([[0.3]]), jnp.ones((1, 1, 3)))
    np.testing.assert_allclose(invisible, 0.3, atol=1e-6)


def test_estimated_opacity_finds_the_share_of_rim_pixels():
    """A square 0.2 on 0.8 whose rim shows 0.5: the share is one half, whatever the mask says."""
    rgb = jnp.full((1, 24, 24, 3), 0.8).at[0, 7:17, 7:17].set(0.5).at[0, 8:16, 8:16].set(0.2)
    for border in (7, 8):
        mask = jnp.zeros((1, 24, 24)).at[0, border : 24 - border, border : 24 - border].set(1.0)
        opacity = np.asarray(estimated_opacity(rgb, mask))[0]
        assert (opacity[10:14, 10:14] == 1).all() and (opacity[:5] == 0).all()
        np.testing.assert_allclose(opacity[7, 9:15], 0.5, atol=0.03 if border == 8 else 0.1)
    thin = jnp.zeros((1, 24, 24)).at[0, 12].set(1.0)
    np.testing.assert_array_equal(estimated_opacity(rgb, thin), thin)


def circle_of_views(image_of, count=5, size=32):
    """Cameras around the origin at 3 m; a metre spans 24 pixels there."""
    places = [(3 * np.cos(a), 3 * np.sin(a), 0.4) for a in 2 * np.pi * np.arange(count) / count]
    poses = jnp.stack([look_at(jnp.array(c), jnp.zeros(3)) for c in places])
    K = jnp.array([[72.0, 0, size / 2], [0, 72.0, size / 2], [0, 0, 1]])
    camera = Camera(jnp.stack([K] * count), poses, size, size)
    rgb, mask = image_of(camera)
    return View(rgb, mask, camera)


def disc(camera):
    """A grey ball of 0.4 m before black: 9.7 pixels in every view, nearly a disc."""
    x = jnp.arange(camera.width) + 0.5 - camera.width / 2
    mask = (jnp.hypot(x[:, None], x[None, :]) < 9.7).astype(jnp.float32)
    mask = jnp.broadcast_to(mask, (len(camera.K), *mask.shape))
    return 0.6 * mask[..., None] * jnp.ones(3), mask


def test_the_fog_fills_the_hull():
    """A ball's hull lies inside all the cones and holds the ball; its colour is the ball's; fewer on demand."""
    views = circle_of_views(disc)
    fog = solid_gaussians(views, config=SolidConfig(capacity=4000))
    radius = np.linalg.norm(fog.mean, axis=-1)
    assert 2000 < len(radius) <= 4000 and radius.max() < 0.7
    # The ball's volume over a cell's.
    cell = float(fog.scale[0, 0]) / 0.5
    assert (radius < 0.38).sum() > 0.95 * (4 / 3 * np.pi * 0.38**3) / cell**3
    np.testing.assert_allclose(fog.sh[radius < 0.3, 0] * 0.28209479 + 0.5, 0.6, atol=1e-3)
    assert len(solid_gaussians(views, config=SolidConfig(capacity=500)).mean) <= 500
    apart = dataclasses.replace(views, mask=views.mask.at[0].set(0.0))
    with pytest.raises(UserError, match="silhouettes of the cameras do not meet"):
        solid_gaussians(apart, config=SolidConfig(capacity=500))


def test_the_shadow_term_takes_away_what_no_view_needs():
    """The hull of a ball from a circle of cameras has caps above and below; the term wears them down."""
    views = circle_of_views(disc)
    start = solid_gaussians(views, config=SolidConfig(capacity=300))
    sums = []
    for weight in (0.0, 1.0):
        config = GaussianFitConfig(steps=30, report_every=30, opacity_rate=0.1, shadow_weight=weight)
        fitted = fit_gaussians(start, views, config=config, key=jax.random.key(0))
        above = look_at(jnp.array([0.0, 0.01, 3.0]), jnp.zeros(3))
        camera = Camera(views.camera.K[:1], above[None], 32, 32)
        sums.append(float(drawing(antialias=True)(fitted, camera, background=jnp.zeros(3)).alpha.sum()))
    assert sums[1] < 0.95 * sums[0], sums


def test_fit_recovers_colour_and_shape():
    """Views of known Gaussians over a backdrop; from grey, half transparent ones in the right places."""
    truth = make_gaussians(0, 24, 1, np.float32, opacity=(0.95, 0.99), sigma=(0.06, 0.12))
    poses = [look_at(jnp.array(c), jnp.zeros(3)) for c in ((2.0, 0, 0.3), (0, 2.0, -0.3), (-1.4, -1.4, 0.2))]
    K = jnp.array([[30.0, 0, 12], [0, 30.0, 12], [0, 0, 1]])
    camera = Camera(jnp.stack([K] * 3), jnp.stack(poses), 24, 24)
    backdrop = jnp.array([0.1, 0.2, 0.3])
    draw = drawing(antialias=True)
    image = draw(truth, camera, background=backdrop)
    views = View(image.colour, image.alpha, camera)
    start = dataclasses.replace(truth, sh=jnp.zeros_like(truth.sh), opacity=jnp.full(24, 0.5))
    losses = []
    config = GaussianFitConfig(steps=60, report_every=30, colour_rate=0.05, opacity_rate=0.1, shadow_weight=0.0)
    fitted = fit_gaussians(
        start, views, config=config, key=jax.random.key(0), report=lambda done, loss: losses.append((done, loss))
    )
    before, after = (draw(g, camera, background=backdrop).colour for g in (start, fitted))
    scores = [float(foreground_psnr(x, image.colour, views.mask)) for x in (before, after)]
    assert [done for done, _ in losses] == [30, 60] and losses[-1][1] < losses[0][1]
    assert scores[1] > 22 and scores[1] > scores[0] + 6, scores
    np.testing.assert_allclose(jnp.linalg.norm(fitted.quaternion, axis=-1), 1.0, rtol=1e-5)
