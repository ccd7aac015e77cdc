"""Photometric losses against hand-computed numbers and scikit-image's formula; the fit recovers what it is shown."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from scipy.ndimage import gaussian_filter
from support.splat_scenes import drawing, make_gaussians

from aerojax.core.types import Camera, View
from aerojax.geometry.cameras import look_at
from aerojax.reconstruct.fit.matte import apparent_opacity, estimated_opacity
from aerojax.reconstruct.fit.optimise import GaussianFitConfig, _move_idle, _State, fit_gaussians
from aerojax.reconstruct.fit.photometric import (
    backdrop_colour,
    certain_pixels,
    foreground_psnr,
    over_backdrop,
    photometric_loss,
    structural_similarity,
    surround_psnr,
)
from aerojax.reconstruct.hull import HullConfig, hull_gaussians


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


def test_the_shadow_term_takes_away_what_no_view_needs():
    """The hull of a ball from a circle of cameras has caps above and below; the term wears them down."""
    views = circle_of_views(disc)
    start = hull_gaussians(views, config=HullConfig(grid=24, capacity=400))
    sums = []
    for weight in (0.0, 1.0):
        config = GaussianFitConfig(steps=30, report_every=30, opacity_rate=0.1, shadow_weight=weight, shadow_decay=1.0)
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


def test_the_idle_become_halves_of_the_busy():
    """Gaussian 2 is pulled most and 0 is invisible: 0 becomes 2's other half, and both stand where 2 stood."""
    start = make_gaussians(1, 4, 1, np.float32, opacity=(0.5, 0.9), sigma=(0.1, 0.2))
    fixed = {"mean": start.mean, "quaternion": start.quaternion, "scale": jnp.log(start.scale), "sh": start.sh}
    free = fixed | {"opacity": jnp.array([-6.0, 1.0, 2.0, 0.0])}
    state = _State(free, {"velocity": jnp.ones((4, 3)), "count": jnp.ones(())}, jnp.array([9.0, 1.0, 5.0, 2.0]))
    moved = _move_idle(state, 1)
    after = moved.free
    np.testing.assert_allclose((after["mean"][0] + after["mean"][2]) / 2, start.mean[2], atol=1e-6)
    longest = int(jnp.argmax(start.scale[2]))
    apart = jnp.linalg.norm(after["mean"][0] - after["mean"][2])
    np.testing.assert_allclose(apart, start.scale[2, longest], rtol=1e-5)
    expected = start.scale[2].at[longest].multiply(0.6)
    np.testing.assert_allclose(jnp.exp(after["scale"][jnp.array([0, 2])]), [expected, expected], rtol=1e-5)
    for name in ("quaternion", "opacity", "sh"):
        np.testing.assert_array_equal(after[name][0], free[name][2])
    for name, x in free.items():
        np.testing.assert_array_equal(after[name][jnp.array([1, 3])], x[jnp.array([1, 3])])
    np.testing.assert_array_equal(moved.moments["velocity"][:, 0], [0.0, 1.0, 1.0, 1.0])
    assert float(moved.moments["count"]) == 1 and not moved.pull.any()


def test_no_gaussian_outgrows_the_limit():
    """Few small Gaussians before a large disc want to grow; the limit holds them, a looser one lets them."""
    views = circle_of_views(disc)
    start = hull_gaussians(views, config=HullConfig(grid=24, capacity=60))
    before = float(start.scale.max())
    largest = []
    for limit in (1.0, 3.0):
        config = GaussianFitConfig(steps=12, report_every=4, scale_rate=0.1, largest=limit, shadow_weight=0.0)
        fitted = fit_gaussians(start, views, config=config, key=jax.random.key(0))
        largest.append(float(fitted.scale.max()) / before)
    assert len(fitted.mean) == len(start.mean)
    assert largest[0] <= 1.0001 and 1.2 < largest[1] <= 3.0001, largest
