"""Cutting an object out: windows, homographies and frames of reference agree with each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation
from support.networks import frame_sets, network, position_at

from aerojax.core.types import Observation
from aerojax.reconstruct.observe import observe
from aerojax.segment.given import GivenConfig

SIZE = 48


def observed(cameras, frame: int, world_from_rig=None, *, cut: int | None = None) -> Observation:
    frames = next(frame_sets(cameras, range(frame, frame + 1)))
    found, _ = GivenConfig().build(3).step(frames, 3)
    silhouettes = [replace(one, whole=one.camera != cut) for one in found]
    placed = np.eye(4) if world_from_rig is None else world_from_rig
    return observe(frames, silhouettes, cameras, size=SIZE, world_from_rig=placed)


def test_a_point_projects_alike_through_image_and_crop():
    cameras = network()
    seen = observed(cameras, 4)
    point = position_at(4) + np.array([0.1, -0.05, 0.02])
    inside = np.linalg.inv(seen.rig_from_crop) @ [*point, 1.0]
    for index, camera in enumerate(cameras):
        through_image = camera.K @ (np.linalg.inv(camera.world_from_cam) @ [*point, 1.0])[:3]
        pixel = seen.crop_from_image[index] @ (through_image / through_image[2])
        virtual = seen.views.camera
        through_crop = (
            np.asarray(virtual.K[index], np.float64)
            @ (np.linalg.inv(np.asarray(virtual.world_from_cam[index], np.float64)) @ inside)[:3]
        )
        np.testing.assert_allclose(pixel[:2] / pixel[2], through_crop[:2] / through_crop[2], atol=2e-4)


def test_windows_are_the_corners_of_the_crops_and_hold_the_boxes():
    seen = observed(network(), 2)
    for index, box in enumerate(seen.boxes):
        corners = np.concatenate([seen.windows[index], np.ones((4, 1))], axis=1) @ seen.crop_from_image[index].T
        expected = [[0, 0], [SIZE, 0], [SIZE, SIZE], [0, SIZE]]
        np.testing.assert_allclose(corners[:, :2] / corners[:, 2:], expected, atol=1e-6)
        low, high = seen.windows[index].min(axis=0), seen.windows[index].max(axis=0)
        assert box is not None and (low < box[:2]).all() and (high > box[2:]).all()


def test_the_object_is_at_the_crop_s_origin_and_the_axes_are_the_rig_s():
    place = np.eye(4)
    place[:3, :3], place[:3, 3] = Rotation.random(random_state=1).as_matrix(), [10.0, -20.0, 3.0]
    seen = observed(network(), 5, place)
    np.testing.assert_allclose(seen.rig_from_crop[:3, 3], position_at(5), atol=0.03)
    np.testing.assert_array_equal(seen.rig_from_crop[:3, :3], np.eye(3))
    np.testing.assert_allclose(seen.world_from_crop, place @ seen.rig_from_crop, atol=1e-12)


def test_a_camera_that_cuts_the_object_off_is_black_and_does_not_count():
    seen = observed(network(), 1, cut=2)
    np.testing.assert_array_equal(seen.valid, [True, True, False, True])
    assert float(seen.views.mask[2].max()) == 0.0 and float(seen.views.rgb[2].max()) == 0.0
    assert float(seen.views.mask[1].max()) > 0.9
