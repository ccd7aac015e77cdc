"""Clocks, scans and the derivative of a sight."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.flights import ring

from aerojax.geometry.cameras import project_points
from aerojax.track.sights import Detections, NoiseConfig, calibration_variance, scans_of, sight_of_points


def test_a_row_is_exposed_when_clock_and_shutter_say():
    camera = replace(ring()[0], time_offset_s=0.25, clock_rate=1.001, line_delay_s=1e-5)
    times = camera.network_time(np.array([10.0, 10.0]), np.array([540.0, 640.0]))
    assert times == pytest.approx([10.01 + 0.25, 10.01 + 0.25 + 1e-3], abs=1e-12)


def test_sights_are_projections_and_their_derivatives():
    camera = ring()[0]
    camera = replace(camera, K=camera.K + np.array([[0, 3.0, 0], [0, 40.0, 0], [0, 0, 0]]))  # skew and another fy
    points = np.random.default_rng(0).normal([0, 0, 20], 8, (5, 3))
    pixels, by_point, depth = sight_of_points(points, camera)
    np.testing.assert_allclose(pixels, project_points(points, camera), rtol=1e-12)
    assert np.all(depth > 20)
    for axis in range(3):
        step = 1e-5 * np.eye(3)[axis]
        ahead, back = (sight_of_points(points + s, camera)[0] for s in (step, -step))
        np.testing.assert_allclose(by_point[..., axis], (ahead - back) / 2e-5, rtol=1e-6, atol=1e-7)


def test_scans_are_images_in_the_networks_order():
    cameras = (ring()[0], replace(ring()[1], time_offset_s=-0.05))
    detections = Detections(
        np.array([0, 1, 0, 1, 0]),
        np.array([0.1, 0.1, 0.0, 0.1, 0.1]),
        np.arange(10.0).reshape(5, 2),
        np.array([0.0, 0, 0, 0, 40.0]),
    )
    scans = scans_of(detections, cameras, NoiseConfig(pixel=2.0, outline=0.1))
    assert [(s.camera, s.rows.tolist()) for s in scans] == [(0, [2]), (1, [1, 3]), (0, [0, 4])]
    assert [s.time_s for s in scans] == pytest.approx([0.0, 0.05, 0.1])
    assert scans[2].variance == pytest.approx([4.0, 20.0])
    assert scans_of(detections.chosen(np.zeros(5, bool)), cameras, NoiseConfig()) == []


def test_calibration_counts_more_for_what_is_near():
    camera = ring()[0]
    near, far = calibration_variance(np.array([10.0, 1e6]), camera, NoiseConfig(rotation_deg=0.1, position_m=0.05))
    assert far == pytest.approx((1300 * np.radians(0.1)) ** 2, rel=1e-6)
    assert near - far == pytest.approx(6.5**2, rel=1e-6)
