"""Moments, polar images and closed-form descriptors against figures of ellipses, and under turns and shifts."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.crop_examples import winged

from aerojax.classify.views.config import ViewsConfig
from aerojax.classify.views.descriptors import outline_descriptors
from aerojax.classify.views.encoder import AngularConvolution, ViewEncoder, outline
from aerojax.classify.views.polar import fourier_magnitudes, last_before, moments, polar_image

CONFIG = ViewsConfig()
GRID = {"radii": CONFIG.radii, "angles": CONFIG.angles, "reach": CONFIG.reach}


def ellipse(a, b, centre=(16.0, 16.0), over=8):
    """Area-averaged coverage of an ellipse with half axes a and b along x and y, pixels."""
    at = (np.arange(32 * over) + 0.5) / over
    inside = ((at - centre[0])[None] / a) ** 2 + ((at - centre[1])[:, None] / b) ** 2 <= 1
    return jnp.asarray(inside.reshape(32, over, 32, over).mean(axis=(1, 3)).astype(np.float32))


def test_moments_of_an_ellipse():
    found = moments(ellipse(12.0, 6.0, centre=(17.0, 15.0)))
    assert float(found.area) == pytest.approx(np.pi * 72, rel=1e-2)
    np.testing.assert_allclose(found.centre, [17.0, 15.0], atol=1e-2)
    # a²/4 and b²/4; the variance within a pixel counts twice: once blurred by the pixels, once by the floor.
    assert float(found.trace) == pytest.approx(45 + 2 / 12, rel=1e-2)
    assert float(found.difference) == pytest.approx(27, rel=1e-2)
    assert float(found.product) == pytest.approx(0, abs=1e-2)
    empty = moments(jnp.zeros((32, 32)))
    np.testing.assert_allclose(empty.centre, [16.0, 16.0])
    assert float(empty.radius) > 0


def test_numbers_of_a_disc_and_of_an_ellipse():
    disc, long = (np.asarray(outline_descriptors(image, moments(image))) for image in (ellipse(10, 10), ellipse(12, 4)))
    # Not stretched, as full as an ellipse, as compact as a disc, no odd and no angular moments; |c_22| = 4/3.
    np.testing.assert_allclose(disc[:3], 0.0, atol=0.02)
    assert abs(disc[3]) < 0.3
    np.testing.assert_allclose(disc[4:], np.log1p([0, 0, 4 / 3, 0, 0]), atol=0.02)
    assert long[0] == pytest.approx(np.log(3), abs=0.03)
    assert long[1] == pytest.approx(0.0, abs=0.03)
    # Ramanujan's perimeter of an ellipse with half axes 12 and 4 is 53.2 pixels.
    assert long[3] == pytest.approx(np.log(53.2**2 / (4 * np.pi * np.pi * 48)), abs=0.3)


def test_a_polar_image_of_a_disc_is_a_step_and_of_a_small_one_the_same():
    rows = []
    for radius, centre in ((12.0, (16.0, 16.0)), (8.0, (14.0, 19.0))):
        image = ellipse(radius, radius, centre)
        polar = polar_image(image[..., None], moments(image), **GRID)[..., 0]
        assert float(polar.std(axis=1).max()) < 0.1
        rows.append(np.asarray(polar.mean(axis=1)))
    # The edge of a disc lies at √2 root mean square radii.
    radius = (np.arange(CONFIG.radii) + 0.5) / CONFIG.radii * CONFIG.reach
    inside, outside = radius < 1.2, radius > 1.65
    for row in rows:
        np.testing.assert_allclose(row[inside], 1.0, atol=1e-3)
        np.testing.assert_allclose(row[outside], 0.0, atol=1e-3)


def crop(image):
    return jnp.repeat(jnp.asarray(image, jnp.float32)[..., None], 4, axis=-1)


def test_a_quarter_turn_shifts_the_polar_image_and_changes_no_descriptor():
    given = crop(winged(0.4, 0.7, shift=(0.8, -0.5)))
    look = jax.jit(lambda image: outline(image, CONFIG))
    first, second = look(given), look(jnp.rot90(given, k=-1))
    shifted = jnp.roll(first.polar, CONFIG.angles // 4, axis=1)
    np.testing.assert_allclose(second.polar, shifted, atol=1e-4)
    np.testing.assert_allclose(second.numbers, first.numbers, atol=2e-3)
    encode = ViewEncoder(CONFIG, key=jax.random.key(0))
    np.testing.assert_allclose(encode(second, second), encode(first, first), atol=1e-3)
    other = look(crop(winged(0.0, 0.7, wing=8.0)))
    assert jnp.abs(encode(other, other) - encode(first, first)).max() > 2e-2


def test_distance_changes_little_and_change_is_read():
    look = jax.jit(lambda image: outline(image, CONFIG))
    near, far = look(crop(ellipse(13, 5))), look(crop(ellipse(10.4, 4)))
    assert float(jnp.abs(near.numbers - far.numbers).mean()) < 0.1
    encode = ViewEncoder(CONFIG, key=jax.random.key(0))
    still, moved = encode(near, near), encode(near, look(crop(ellipse(13, 9))))
    assert jnp.abs(still - moved).max() > 1e-2


def test_fourier_magnitudes_of_waves():
    angle = 2 * np.pi * np.arange(32) / 32
    wave = jnp.asarray(0.5 + 0.3 * np.cos(2 * angle + 0.4) + 0.1 * np.sin(5 * angle), jnp.float32)[:, None]
    found = np.asarray(fourier_magnitudes(wave, 0, 6))[:, 0]
    np.testing.assert_allclose(found, [0.5, 0, 0.15, 0, 0, 0.05, 0], atol=1e-3)
    slope = jax.grad(lambda x: fourier_magnitudes(x, 0, 6).sum())(jnp.zeros((32, 1)))
    assert bool(jnp.isfinite(slope).all())


@pytest.mark.parametrize("dilation", [1, 4])
def test_a_convolution_on_the_circle_is_equivariant_to_shifts_and_sees_its_taps(dilation):
    layer = AngularConvolution(3, 5, 3, dilation, key=jax.random.key(0))
    x = jax.random.normal(jax.random.key(1), (32, 3))
    np.testing.assert_allclose(layer(jnp.roll(x, 7, axis=0)), jnp.roll(layer(x), 7, axis=0), atol=1e-6)
    touched = jnp.abs(layer(x.at[10].add(1.0)) - layer(x)).max(axis=1) > 1e-6
    assert np.flatnonzero(touched).tolist() == [10 - dilation, 10, 10 + dilation]


def test_the_last_frame_before_in_which_a_view_was_valid():
    valid = jnp.array([[0, 1], [1, 0], [0, 0], [1, 1]], bool)
    index, seen = last_before(valid)
    np.testing.assert_array_equal(seen, [[0, 0], [0, 1], [1, 1], [1, 1]])
    np.testing.assert_array_equal(np.where(seen, index, -1), [[-1, -1], [-1, 0], [1, 0], [1, 0]])
