"""The fixed rigs of Sim-1, Sim-2 and Sim-3 as the thesis has them."""

from __future__ import annotations

import numpy as np
import pytest
from support.dataset_configs import config_of

from aerojax.geometry.cameras import project_points
from aerojax.simulate.plan.dataset import fixed_rig
from aerojax.simulate.world.fixed_rigs import conditions, place_cameras


def test_sim1_is_the_published_sweep():
    rig = fixed_rig(config_of("rig=sim1", "preset=full"))
    assert [(c.radius, c.elevation_deg) for c in conditions(rig)][:3] == [(2, -20), (2, 20), (4, -20)]
    assert len(conditions(rig)) == 20
    for condition in conditions(rig):
        cameras = place_cameras(rig, condition)
        centres = np.stack([camera.world_from_cam[:3, 3] for camera in cameras])
        np.testing.assert_allclose(np.linalg.norm(centres, axis=1), condition.radius)
        np.testing.assert_allclose(np.rad2deg(np.arcsin(centres[:, 2] / condition.radius)), condition.elevation_deg)
        azimuth = np.rad2deg(np.arctan2(centres[:, 1], centres[:, 0])) % 360
        np.testing.assert_allclose(azimuth, [45, 135, 225, 315])
        for camera in cameras:
            np.testing.assert_allclose(project_points(np.zeros((1, 3)), camera)[0], [1280, 720], atol=1e-9)
    assert rig.focal_px == pytest.approx(10 * 128 / np.tan(np.deg2rad(49.1 / 2)), rel=1e-4)


def test_sim2_is_a_circle_that_looks_down():
    rig = fixed_rig(config_of("rig=sim2", "preset=full"))
    (condition,) = conditions(rig)
    centres = np.stack([c.world_from_cam[:3, 3] for c in place_cameras(rig, condition)])
    np.testing.assert_allclose(np.hypot(centres[:, 0], centres[:, 1]), 100.0)
    np.testing.assert_allclose(centres[:, 2], 37.0)
    assert len(centres) == 5 and rig.aim[2] == 37.0 - 15.0
    assert 2 * np.rad2deg(np.arctan(720 / rig.focal_px)) == pytest.approx(30.0, abs=0.01)


def test_sim3_is_a_line_of_fifty_metres():
    rig = fixed_rig(config_of("rig=sim3", "preset=full"))
    centres = np.stack([c.world_from_cam[:3, 3] for c in place_cameras(rig, conditions(rig)[0])])
    assert np.linalg.norm(centres[0] - centres[-1]) == pytest.approx(50.0)
    np.testing.assert_allclose(centres[:, 2], 8.0)
    assert np.linalg.matrix_rank(centres - centres[0], tol=1e-9) == 1 and len(centres) == 5
