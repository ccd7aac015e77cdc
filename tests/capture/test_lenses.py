"""Lens distortion against OpenCV's point functions, and drawn dots that must land where the formulas say."""

from __future__ import annotations

import dataclasses

import cv2
import numpy as np
import pytest
from support.broken_captures import make_camera

from aerojax.capture.format import Capture
from aerojax.capture.frames import read_depth, read_mask, read_rgb
from aerojax.capture.lenses import COEFFICIENT_COUNTS, distort_points, undistort_image, undistort_points
from aerojax.capture.write import write_frame

K = np.array([[180.0, 0.0, 101.0], [0.0, 175.0, 74.0], [0.0, 0.0, 1.0]])
WIDTH, HEIGHT = 200, 150
LENSES = [
    ("opencv", (-0.25, 0.08, 0.002, -0.001)),
    ("opencv", (-0.25, 0.08, 0.002, -0.001, 0.01)),
    ("opencv", (0.3, -0.1, 0.001, 0.002, 0.02, 0.25, -0.05, 0.01)),
    ("opencv", (-0.2, 0.05, 0.001, 0.002, 0.02, 0.01, 0.0, 0.0, 0.003, 0.0, -0.002, 0.0)),
    ("opencv", (-0.2, 0.05, 0.001, 0.002, 0.02, 0.01, 0.0, 0.0, 0.003, 0.0, -0.002, 0.0, 0.01, -0.02)),
    ("opencv_fisheye", (-0.05, 0.01, -0.003, 0.001)),
]
POINTS = np.array([[101.0, 74.0], [40.0, 30.0], [160.5, 110.25], [101.0, 20.0], [30.0, 120.0]])


def dot(centre: np.ndarray) -> np.ndarray:
    """A soft white dot; its pixel (column j, row i) is sampled at (j + 0.5, i + 0.5)."""
    u, v = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
    return np.exp(-((u - centre[0]) ** 2 + (v - centre[1]) ** 2) / (2 * 1.5**2)).astype(np.float32)


def centroid(image: np.ndarray) -> np.ndarray:
    u, v = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
    return np.array([(image * u).sum(), (image * v).sum()]) / image.sum()


def test_every_coefficient_count_is_tested():
    assert {(m, n) for m, counts in COEFFICIENT_COUNTS.items() for n in counts} == {
        ("none", 0),
        *((model, len(coefficients)) for model, coefficients in LENSES),
    }


@pytest.mark.parametrize(("model", "coefficients"), LENSES)
def test_points_return(model, coefficients):
    distorted = distort_points(POINTS, K, model, coefficients)
    assert np.abs(distorted - POINTS).max() > 0.5
    np.testing.assert_allclose(undistort_points(distorted, K, model, coefficients), POINTS, atol=1e-6)


def test_points_match_the_written_formula():
    """x_d = x (1 + k1 r² + k2 r⁴) + 2 p1 x y + p2 (r² + 2x²) (Brown 1966), in normalised coordinates."""
    k1, k2, p1, p2 = LENSES[0][1]
    x, y = (POINTS - K[:2, 2]).T / np.array([[180.0], [175.0]])
    r2 = x * x + y * y
    radial = 1 + k1 * r2 + k2 * r2**2
    u = 180 * (x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)) + 101
    v = 175 * (y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y) + 74
    np.testing.assert_allclose(distort_points(POINTS, K, *LENSES[0]), np.stack([u, v], axis=1), atol=1e-9)


def test_points_match_opencv_with_the_half_pixel_shift():
    """OpenCV with its own convention: the same lens in a frame whose origin is a pixel centre."""
    model, coefficients = LENSES[1]
    shifted = K - np.array([[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]])
    theirs = cv2.undistortPoints((POINTS - 0.5)[:, None], shifted, np.array(coefficients), P=shifted)[:, 0] + 0.5
    np.testing.assert_allclose(undistort_points(POINTS, K, model, coefficients), theirs, atol=0.02)


@pytest.mark.parametrize(("model", "coefficients"), LENSES)
@pytest.mark.parametrize("point", POINTS[1:])
def test_dot_in_a_distorted_image_lands_on_its_pinhole_pixel(model, coefficients, point):
    stored = dot(distort_points(point[None], K, model, coefficients)[0])
    np.testing.assert_allclose(centroid(undistort_image(stored, K, model, coefficients)), point, atol=0.06)


def test_dot_at_a_wrong_convention_is_noticed():
    """The negative control: half a pixel is far above the tolerance of the test before this one."""
    model, coefficients = LENSES[0]
    stored = dot(distort_points(POINTS[1][None] + 0.5, K, model, coefficients)[0])
    assert np.abs(centroid(undistort_image(stored, K, model, coefficients)) - POINTS[1]).max() > 0.3


def test_no_lens_changes_nothing():
    image = dot(POINTS[1])
    assert undistort_image(image, K, "none", ()) is image
    np.testing.assert_array_equal(undistort_points(POINTS, K, "none", ()), POINTS)
    np.testing.assert_array_equal(distort_points(POINTS, K, "none", ()), POINTS)


def test_reading_undistorts_colour_mask_and_depth(tmp_path):
    model, coefficients = LENSES[0]
    camera = dataclasses.replace(
        make_camera(0), K=K, width=WIDTH, height=HEIGHT, distortion_model=model, distortion=coefficients
    )
    soft = dot(distort_points(POINTS[4][None], K, model, coefficients)[0])
    mask = np.where(soft > 0.3, np.uint16(513), np.uint16(0))
    write_frame(tmp_path, camera, 0, np.repeat(soft[..., None], 3, axis=2), mask, np.where(mask, np.float32(7.25), 0))
    capture = Capture(tmp_path, 30.0, 1, (camera,), None)
    colour, ids, depth = read_rgb(capture, 0, 0), read_mask(capture, 0, 0), read_depth(capture, 0, 0)
    np.testing.assert_allclose(centroid(colour[..., 0]), POINTS[4], atol=0.06)
    assert set(np.unique(ids)) == {0, 513} and set(np.unique(depth)) == {0.0, 7.25}
    np.testing.assert_allclose(centroid((ids > 0).astype(np.float32)), POINTS[4], atol=0.3)
    np.testing.assert_array_equal(depth > 0, ids > 0)
