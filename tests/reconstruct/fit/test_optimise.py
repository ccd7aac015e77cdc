"""The fit recovers what it is shown, and its regulariser, limit and relocation do what they are for."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.splat_scenes import drawing, make_gaussians

from aerojax.core.images import peak_signal_to_noise
from aerojax.core.types import Camera, View
from aerojax.geometry.cameras import look_at
from aerojax.reconstruct.fit.optimise import GaussianFitConfig, _relocate, _State, depth_observed, fit_gaussians
from aerojax.reconstruct.fit.start import only_real
from aerojax.reconstruct.hull import HullConfig

CONFIG = GaussianFitConfig(steps=30, report_every=10, alpha_weight=0.0)
HULL = HullConfig(grid=24, capacity=200)
"""Of one size, so that the same compiled steps serve several tests; weights and rates may differ."""


def circle_of_views(image_of, count=5, size=32):
    """Cameras around the origin at 3 m; a metre spans 24 pixels there."""
    return arc_of_views(image_of, 2 * np.pi * np.arange(count) / count, size)


def arc_of_views(image_of, angles, size=32):
    """The same at given azimuths, radians."""
    count, places = len(angles), [(3 * np.cos(a), 3 * np.sin(a), 0.4) for a in angles]
    poses = jnp.stack([look_at(jnp.array(c), jnp.zeros(3)) for c in places])
    K = jnp.array([[72.0, 0, size / 2], [0, 72.0, size / 2], [0, 0, 1]])
    camera = Camera(jnp.stack([K] * count), poses, size, size)
    rgb, mask = image_of(camera)
    return View(rgb, mask, camera)


def disc(camera):
    """A grey ball of 0.4 m before black: 9.7 pixels in every view, nearly a disc."""
    x = jnp.arange(camera.width, dtype=jnp.float32) + 0.5 - camera.width / 2
    mask = (jnp.hypot(x[:, None], x[None, :]) < 9.7).astype(jnp.float32)
    mask = jnp.broadcast_to(mask, (len(camera.K), *mask.shape))
    return 0.6 * mask[..., None] * jnp.ones((1, 1, 1, 3)), mask


@pytest.mark.long
def test_the_alpha_regulariser_takes_away_what_no_view_needs():
    """The hull of a ball from a circle of cameras has caps above and below; the term wears them down."""
    views = circle_of_views(disc)
    start = only_real(HULL.build(), views)
    sums = []
    for weight in (0.0, 1.0):
        config = dataclasses.replace(CONFIG, alpha_weight=weight, alpha_decay=1.0)
        fitted = fit_gaussians(start, views, config=config, key=jax.random.key(0))
        above = look_at(jnp.array([0.0, 0.01, 3.0]), jnp.zeros(3))
        camera = Camera(views.camera.K[:1], above[None], 32, 32)
        sums.append(float(drawing(antialias=True)(fitted, camera, background=jnp.zeros(3)).alpha.sum()))
    assert sums[1] < 0.95 * sums[0], sums


def test_fit_recovers_colour_and_shape():
    """Views of known Gaussians over a background; from grey, half transparent ones in the right places."""
    start = only_real(HULL.build(), circle_of_views(disc))
    truth = make_gaussians(0, len(start.mean), 1, np.float32, opacity=(0.95, 0.99), sigma=(0.02, 0.06), spread=0.2)
    background, draw = jnp.array([0.1, 0.2, 0.3]), drawing(antialias=True)

    def image_of(camera):
        image = draw(truth, camera, background=background)
        return image.colour, image.alpha

    views = circle_of_views(image_of)
    start = dataclasses.replace(truth, sh=jnp.zeros_like(truth.sh), opacity=jnp.full(len(truth.mean), 0.5, jnp.float32))
    losses = []
    config = dataclasses.replace(CONFIG, colour_rate=0.1, opacity_rate=0.2)
    fitted = fit_gaussians(
        start, views, config=config, key=jax.random.key(0), report=lambda done, loss: losses.append((done, loss))
    )
    before, after = (draw(g, views.camera, background=background).colour for g in (start, fitted))
    scores = [float(peak_signal_to_noise(x, views.rgb, views.mask)) for x in (before, after)]
    assert [done for done, _ in losses] == [10, 20, 30] and losses[-1][1] < losses[0][1]
    assert scores[1] > 30 and scores[1] > scores[0] + 6, scores
    np.testing.assert_allclose(jnp.linalg.norm(fitted.quaternion, axis=-1), 1.0, rtol=1e-5)


def test_depth_is_known_to_cameras_all_around_and_hardly_to_a_short_arc():
    around, narrow, apart = (
        arc_of_views(disc, angles).camera
        for angles in (np.arange(0.0, 6.0), np.linspace(-0.1, 0.1, 5), np.array([-0.6, 0.6]))
    )
    assert float(depth_observed(around)) == 1.0 == float(depth_observed(apart))
    # Five cameras at up to 0.1 radians: the mean square of the angle, 0.005, over a quarter.
    np.testing.assert_allclose(depth_observed(narrow), 0.005 / 0.25, rtol=0.05)


def test_the_alpha_regulariser_hardly_acts_before_cameras_on_a_short_arc():
    """What it would take away there is depth that no camera has seen."""
    views = arc_of_views(disc, np.linspace(-0.15, 0.15, 5))
    start, sums = only_real(HULL.build(), views), []
    for weight in (0.0, 1.0):
        config = dataclasses.replace(CONFIG, alpha_weight=weight, alpha_decay=1.0)
        fitted = fit_gaussians(start, views, config=config, key=jax.random.key(0))
        aside = look_at(jnp.array([0.0, 3.0, 0.0]), jnp.zeros(3))
        camera = Camera(views.camera.K[:1], aside[None], 32, 32)
        sums.append(float(drawing(antialias=True)(fitted, camera, background=jnp.zeros(3)).alpha.sum()))
    assert sums[1] > 0.9 * sums[0], sums


def test_no_gaussian_outgrows_the_limit():
    """Few small Gaussians before a large disc want to grow; the limit holds them, a looser one lets them."""
    views = circle_of_views(disc)
    start = only_real(HULL.build(), views)
    before = float(start.scale.max())
    largest = []
    for limit in (1.0, 3.0):
        config = dataclasses.replace(CONFIG, scale_rate=0.1, max_scale=limit)
        fitted = fit_gaussians(start, views, config=config, key=jax.random.key(0))
        largest.append(float(fitted.scale.max()) / before)
    assert len(fitted.mean) == len(start.mean)
    assert largest[0] <= 1.0001 and 1.2 < largest[1] <= 3.0001, largest


def test_the_relocated_become_halves_of_the_split():
    """Gaussian 0 is invisible and 2 has the largest gradient of the others: 0 becomes 2's other half."""
    start = make_gaussians(1, 4, 1, np.float32, opacity=(0.5, 0.9), sigma=(0.1, 0.2))
    fixed = {"mean": start.mean, "quaternion": start.quaternion, "scale": jnp.log(start.scale), "sh": start.sh}
    old = fixed | {"opacity": jnp.array([-6.0, 1.0, 2.0, 0.0])}
    moments = {"velocity": jnp.ones((4, 3)), "count": jnp.ones(())}
    state = _State(old, moments, jnp.array([9.0, 1.0, 5.0, 2.0]))
    moved = _relocate(state, 1)
    after = moved.parameters
    np.testing.assert_allclose((after["mean"][0] + after["mean"][2]) / 2, start.mean[2], atol=1e-6)
    longest = int(jnp.argmax(start.scale[2]))
    apart = jnp.linalg.norm(after["mean"][0] - after["mean"][2])
    np.testing.assert_allclose(apart, start.scale[2, longest], rtol=1e-5)
    expected = start.scale[2].at[longest].multiply(0.6)
    np.testing.assert_allclose(jnp.exp(after["scale"][jnp.array([0, 2])]), [expected, expected], rtol=1e-5)
    for name in ("quaternion", "opacity", "sh"):
        np.testing.assert_array_equal(after[name][0], old[name][2])
    for name, x in old.items():
        np.testing.assert_array_equal(after[name][jnp.array([1, 3])], x[jnp.array([1, 3])])
    np.testing.assert_array_equal(moved.moments["velocity"][:, 0], [0.0, 1.0, 1.0, 1.0])
    assert float(moved.moments["count"]) == 1 and not moved.gradient_norm.any()
