"""Silhouettes as functions: against SciPy's distance transform and interpolation."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import ndimage

from aerojax.reconstruct.silhouette import bilinear, known_at, signed_distance

REACH = 6


def blobs(seed):
    noise = ndimage.gaussian_filter(np.random.default_rng(seed).normal(size=(48, 48)), 3)
    return (noise > 0).astype(np.float32)


@pytest.mark.parametrize("seed", range(3))
def test_distance_within_reach_is_exact(seed):
    mask = blobs(seed)
    inside = ndimage.distance_transform_edt(mask > 0.5) - 0.5
    outside = 0.5 - ndimage.distance_transform_edt(mask < 0.5)
    exact = np.where(mask > 0.5, inside, outside)
    ours = np.asarray(jax.jit(lambda m: signed_distance(m, reach=REACH))(mask))
    near = np.abs(exact) < REACH - 1
    assert near.sum() > 500 and (~near).sum() > 10
    np.testing.assert_allclose(ours[near], exact[near], atol=1e-5)
    # Beyond the reach the sign stays and the size is cut off.
    assert (np.sign(ours) == np.sign(exact)).all()
    assert np.abs(ours[~near]).min() >= REACH - 1.01 and np.abs(ours).max() <= REACH


def test_where_an_image_ends_is_no_outline():
    mask, known = blobs(0) > 0.5, np.ones((48, 48), bool)
    known[:, 20:] = False
    shown, filled = mask & known, mask | ~known
    inside = ndimage.distance_transform_edt(filled) - 0.5  # to the nearest known pixel of the background
    outside = 0.5 - ndimage.distance_transform_edt(~shown)  # to the nearest known pixel of the object
    exact = np.clip(np.where(filled, inside, outside), 0.5 - REACH, REACH - 0.5)
    any_mask = np.where(known, mask, np.random.default_rng(1).random(mask.shape) > 0.5).astype(np.float32)
    ours = np.asarray(jax.jit(lambda m, k: signed_distance(m, k, reach=REACH))(any_mask, known))
    np.testing.assert_allclose(ours, exact, atol=1e-5)
    crossing = signed_distance(jnp.asarray(mask, jnp.float32), reach=REACH)
    assert np.abs(ours - np.asarray(crossing))[known].max() > 1.0  # negative control


def test_known_pixels_are_looked_up_at_the_nearest():
    known = jnp.array([[True, False], [False, False]])
    pixels = jnp.array([[0.9, 0.9], [1.1, 0.5], [-3.0, -1.0], [0.5, 7.0]])
    np.testing.assert_array_equal(known_at(known, pixels), [True, False, True, False])


def test_empty_and_full_masks():
    np.testing.assert_array_equal(signed_distance(jnp.zeros((8, 8)), reach=4), -3.5)
    full = np.asarray(signed_distance(jnp.ones((20, 20)), reach=4))
    assert full[10, 10] == 3.5


def test_one_pixel():
    mask = jnp.zeros((9, 9)).at[4, 4].set(1.0)
    distance = np.asarray(signed_distance(mask))
    assert distance[4, 4] == 0.5
    assert distance[4, 5] == -0.5
    assert distance[5, 5] == pytest.approx(0.5 - np.sqrt(2))


@pytest.mark.parametrize("channels", [(), (3,)])
def test_bilinear_is_linear_interpolation(channels):
    rng = np.random.default_rng(0)
    image = rng.uniform(size=(20, 30, *channels)).astype(np.float32)
    pixels = rng.uniform(-5, 35, (200, 2)).astype(np.float32)
    ours = np.asarray(bilinear(jnp.asarray(image), jnp.asarray(pixels))).reshape(200, -1)
    flat = image.reshape(20, 30, -1)
    for channel in range(flat.shape[-1]):
        at = [pixels[:, 1] - 0.5, pixels[:, 0] - 0.5]
        exact = ndimage.map_coordinates(flat[..., channel], at, order=1, mode="nearest")
        np.testing.assert_allclose(ours[:, channel], exact, atol=2e-5)


def test_bilinear_at_pixel_centres_and_corners():
    image = jnp.array([[0.0, 1.0], [2.0, 3.0]])
    values = bilinear(image, jnp.array([[0.5, 0.5], [1.5, 0.5], [1.0, 1.0], [9.0, 9.0], [-9.0, 1.0]]))
    np.testing.assert_allclose(values, [0.0, 1.0, 1.5, 3.0, 1.0])
