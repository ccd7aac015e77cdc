"""The scene's origin, ground and first view."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from support.report_examples import make_camera

from aerojax.view.viewer.scene import first_yaw, scene_data

PLACES = np.array([[1.0, 2.0, 8.0], [3.0, 2.0, 8.0]])


def moved(by: np.ndarray):
    cameras = [make_camera(index, f"c{index}") for index in range(3)]
    for camera in cameras:
        camera.world_from_cam[:3, 3] += by
    return scene_data(cameras, [PLACES[0] + by, None], PLACES + by, 0.5)


def test_a_far_origin_changes_nothing():
    near, far = moved(np.zeros(3)), moved(np.array([500_000.0, 5_600_000.0, 0.0]))
    assert far["track"] == near["track"] == [[-1.0, 0.0, 0.0], None]
    assert far["ground"] == near["ground"] == -8.0
    for one, other in zip(near["rig"], far["rig"], strict=True):
        np.testing.assert_allclose(one["centre"], other["centre"], atol=2e-4)


def test_the_ground_lies_below_everything():
    assert moved(np.array([0.0, 0.0, -20.0]))["ground"] == pytest.approx(2.0 - 8.0)


def test_all_is_within_the_extent_of_the_middle():
    scene = moved(np.zeros(3))
    away = [np.linalg.norm(np.subtract(camera["centre"], scene["middle"])) for camera in scene["rig"]]
    assert max(away) <= scene["extent"] + 1e-3


def test_the_first_view_stands_beside_the_first_camera():
    camera = make_camera(0, "a")
    aside = dataclasses.replace(camera, world_from_cam=np.eye(4))
    assert first_yaw([aside], np.array([0.0, 5.0, 0.0])) == pytest.approx(-90 + 30)
    assert first_yaw([], np.zeros(3)) == pytest.approx(30)
