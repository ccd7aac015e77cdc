"""Rigs: where cameras stand, where they look and how large a metre appears."""

from __future__ import annotations

import numpy as np
import pytest

from aerojax.geometry.cameras import look_at, project_points
from aerojax.simulate.world.random_rigs import RandomRigConfig, draw_rig

KINDS = ("sphere", "circle", "line")
TARGET = np.array([3.0, -2.0, 9.0])


def rig(kind, seed, **changes):
    settings = {"kind": kind, "cameras": 5, "distance": (8.0, 32.0), "span_px": (50.0, 120.0)} | changes
    return draw_rig(RandomRigConfig(**settings), TARGET, np.random.default_rng(seed))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(5))
def test_cameras_look_at_the_target_and_see_a_metre_as_asked(kind, seed):
    cameras = rig(kind, seed, distance=(20.0, 20.0), span_px=(80.0, 80.0))
    assert [c.name for c in cameras] == [f"cam_{i:02d}" for i in range(1, 6)]
    for camera in cameras:
        centre = np.array([camera.width / 2, camera.height / 2])
        np.testing.assert_allclose(project_points(TARGET[None], camera)[0], centre, atol=1e-9)
        assert np.linalg.norm(camera.world_from_cam[:3, 3] - TARGET) == pytest.approx(20.0)
        right, down = camera.world_from_cam[:3, 0], camera.world_from_cam[:3, 1]
        np.testing.assert_allclose(project_points((TARGET + right)[None], camera)[0] - centre, [80.0, 0.0], atol=1e-9)
        np.testing.assert_allclose(project_points((TARGET + down)[None], camera)[0] - centre, [0.0, 80.0], atol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_poses_are_rigid_and_upright(kind):
    for camera in rig(kind, 3):
        turn = camera.world_from_cam[:3, :3]
        np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(turn) == pytest.approx(1.0)
        assert turn[2, 1] < 0 and abs(turn[2, 0]) < 1e-12  # down is down, rows are level


def elevations(cameras):
    away = np.stack([c.world_from_cam[:3, 3] - TARGET for c in cameras])
    return np.rad2deg(np.arcsin(away[:, 2] / np.linalg.norm(away, axis=1)))


@pytest.mark.parametrize("seed", range(5))
def test_layouts(seed):
    sphere = elevations(rig("sphere", seed, elevation_deg=(-30.0, 40.0)))
    circle = elevations(rig("circle", seed, elevation_deg=(-30.0, 40.0)))
    assert sphere.min() >= -30 and sphere.max() <= 40 and np.ptp(sphere) > 1.0
    assert np.ptp(circle) < 1e-9
    away = np.stack([c.world_from_cam[:3, 3] - TARGET for c in rig("line", seed)])
    angle = np.rad2deg(np.arccos(away[0] @ away[-1] / np.linalg.norm(away[0]) / np.linalg.norm(away[-1])))
    assert 15.0 < angle < 60.0
    assert np.linalg.matrix_rank(away, tol=1e-6) == 2  # all in one plane with the target


def test_draws_stay_in_their_ranges_and_follow_the_generator():
    for seed in range(10):
        cameras = rig("sphere", seed)
        distance = np.linalg.norm(cameras[0].world_from_cam[:3, 3] - TARGET)
        assert 8.0 <= distance <= 32.0
        assert 50.0 <= cameras[0].K[0, 0] / distance <= 120.0
    np.testing.assert_array_equal(rig("line", 4)[2].world_from_cam, rig("line", 4)[2].world_from_cam)


def test_looking_straight_up_and_down_is_defined():
    for side in (1.0, -1.0):
        pose = look_at(np.array([0.0, 0.0, -5.0 * side]), np.zeros(3))
        np.testing.assert_allclose(pose[:3, 2], [0.0, 0.0, side], atol=1e-12)
        np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-12)
        np.testing.assert_allclose(pose[:3, 1], [-1.0, 0.0, 0.0], atol=1e-12)
