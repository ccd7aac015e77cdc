"""The virtual-camera crop against stored numbers of an independent implementation (corner form, exact focal)."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

from aerojax.core.types import Camera
from aerojax.geometry.cameras import points_in_camera, project_points
from aerojax.geometry.triangulation import intersect_rays
from aerojax.reconstruct.crop import crop_cameras, crop_window

RIGS = {"A": ("A0", "A1", "A2", "A3"), "B": ("B0", "B1")}
SIZE = 256


@pytest.fixture
def golden(shared):
    with np.load(shared / "golden/crop/crops.npz") as stored:
        return dict(stored)


def world_from_cam(golden, name):
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = golden[f"{name}_R"].T, golden[f"{name}_C"]
    return pose


def crops_of(golden, rig):
    names = RIGS[rig]
    poses = np.stack([world_from_cam(golden, n) for n in names])
    boxes = np.stack([golden[f"{n}_bbox_xyxy"] for n in names]).astype(np.float64)
    return crop_cameras(np.stack([golden[f"{n}_K"] for n in names]), poses, boxes, size=SIZE)


@pytest.mark.parametrize("rig", RIGS)
def test_cameras_and_homographies(golden, rig):
    crops = crops_of(golden, rig)
    for index, name in enumerate(RIGS[rig]):
        np.testing.assert_allclose(crops.camera.K[index], golden[f"{name}_K_corner"], rtol=1e-10)
        np.testing.assert_allclose(crops.ray[index], golden[f"{name}_crop_ray_world"], atol=1e-12)
        assert np.tan(crops.half_angle[index]) == pytest.approx(float(golden[f"{name}_tan_theta_corner"]), rel=1e-10)
        new_pose = crops.camera.world_from_cam[index]
        np.testing.assert_allclose(new_pose[:3, :3].T, golden[f"{name}_R_new"], atol=1e-12)
        np.testing.assert_allclose(new_pose[:3, 3], golden[f"{name}_C"], atol=1e-12)
        turn = new_pose[:3, :3].T @ golden[f"{name}_R"].T
        np.testing.assert_allclose(turn, golden[f"{name}_R_virtual"], atol=1e-12)
        ours, theirs = crops.crop_from_image[index], golden[f"{name}_H_corner"]
        np.testing.assert_allclose(ours / ours[2, 2], theirs / theirs[2, 2], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("rig", RIGS)
def test_points_through_homography_and_through_camera(golden, rig, x64):
    crops = crops_of(golden, rig)
    for index, name in enumerate(RIGS[rig]):
        expected = golden[f"{name}_points_crop_corner"]
        pixels = (
            np.concatenate([golden[f"{name}_points_px"], np.ones((10, 1))], axis=1) @ crops.crop_from_image[index].T
        )
        np.testing.assert_allclose(pixels[:, :2] / pixels[:, 2:], expected, atol=1e-7)
        pose = jnp.asarray(crops.camera.world_from_cam[index])
        camera = Camera(jnp.asarray(crops.camera.K[index]), pose, SIZE, SIZE)
        projected = project_points(jnp.asarray(golden[f"{name}_points_world"]), camera)
        np.testing.assert_allclose(projected, expected, atol=1e-7)


@pytest.mark.parametrize("rig", RIGS)
def test_where_the_crop_rays_meet(golden, rig, x64):
    crops = crops_of(golden, rig)
    centres = jnp.asarray(crops.camera.world_from_cam[:, :3, 3])
    meeting = intersect_rays(centres, jnp.asarray(crops.ray))
    np.testing.assert_allclose(meeting, golden[f"{RIGS[rig][0]}_X0"], atol=1e-8)
    for index in range(len(RIGS[rig])):
        camera = Camera(jnp.eye(3), jnp.asarray(crops.camera.world_from_cam[index]), SIZE, SIZE)
        in_crop = points_in_camera(meeting, camera)
        assert float(jnp.linalg.norm(in_crop[:2]) / in_crop[2]) < np.tan(crops.half_angle[index])


def test_window_is_the_square_about_the_box(golden):
    for name in RIGS["A"]:
        corners = crop_window(jnp.asarray(golden[f"{name}_bbox_xyxy"], jnp.float32))
        side = float(golden[f"{name}_window_side"])
        np.testing.assert_allclose(np.ptp(corners, axis=0), side, rtol=1e-5)


def test_the_comparison_can_fail(golden):
    # The focal length of the edge form differs: the two forms are told apart.
    assert abs(golden["A0_K_edge"][0, 0] / crops_of(golden, "A").camera.K[0, 0, 0] - 1) > 1e-8
