"""Resampling into crops: where pixels land, what lies outside, and thin rods."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

from aerojax.core.types import Camera
from aerojax.reconstruct.crop import crop_camera, crop_image, crop_window


def scaling(factor, shift=0.0):
    return np.array([[factor, 0.0, shift], [0.0, factor, shift], [0.0, 0.0, 1.0]])


def test_window_by_hand():
    corners = crop_window(jnp.array([10.0, 20.0, 30.0, 30.0]))
    np.testing.assert_allclose(corners, [[8, 13], [32, 13], [32, 37], [8, 37]], atol=1e-5)


def test_central_box_gives_the_plain_crop():
    K = jnp.array([[100.0, 0.0, 50.0], [0.0, 100.0, 40.0], [0.0, 0.0, 1.0]])
    crop = crop_camera(Camera(K, jnp.eye(4), 100, 80), jnp.array([40.0, 30.0, 60.0, 50.0]), size=64, margin=1.0)
    np.testing.assert_allclose(crop.camera.world_from_cam, np.eye(4), atol=1e-6)
    np.testing.assert_allclose(crop.camera.K, [[320, 0, 32], [0, 320, 32], [0, 0, 1]], rtol=1e-5)
    np.testing.assert_allclose(crop.crop_from_image @ jnp.array([40.0, 30.0, 1.0]), [0, 0, 1], atol=1e-4)
    np.testing.assert_allclose(crop.ray, [0, 0, 1], atol=1e-6)
    assert float(crop.half_angle) == pytest.approx(np.arctan(0.1), rel=1e-5)


def test_identity_copies():
    image = np.random.default_rng(0).uniform(0, 1, (12, 12, 3)).astype(np.float32)
    np.testing.assert_allclose(crop_image(image, np.eye(3), size=12), image, atol=1e-6)


def test_enlargement_keeps_continuous_pixel_coordinates():
    # A ramp equal to its own continuous x coordinate over 16 stays that ramp.
    ramp = np.tile((np.arange(16) + 0.5) / 16, (16, 1)).astype(np.float32)
    big = crop_image(ramp, scaling(4.0), size=64)
    expected = (np.arange(64) + 0.5) / 64
    # Cubic interpolation ripples by 0.003; half a pixel of shift would be 0.03.
    np.testing.assert_allclose(big[32, 8:-8], expected[8:-8], atol=4e-3)


def test_shrinking_keeps_a_thin_rod():
    image = np.zeros((128, 128), np.float32)
    image[:, 61] = 1.0
    small = crop_image(image, scaling(0.25), size=32)
    assert small.max(axis=1).min() > 0.1  # in every row, wherever the rod falls between samples
    np.testing.assert_allclose(small[8:-8].sum(axis=1), 0.25, atol=0.04)  # its area stays


def test_beyond_the_border_is_the_given_value():
    shifted = crop_image(np.zeros((8, 8), np.float32), scaling(1.0, shift=20.0), size=16, outside=1.0)
    assert shifted.min() == 1.0
    assert crop_image(np.ones((8, 8), np.float32), scaling(1.0, shift=20.0), size=16).max() == 0.0
