"""The virtual-camera crop is a camera: points land where the homography puts them, and all crops look at one point."""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from aerojax.core.types import Camera
from aerojax.geometry.cameras import look_at, project_points
from aerojax.geometry.triangulation import intersect_rays
from aerojax.reconstruct.crop import crop_cameras

SIZE, HALF = 128, 0.4
"""Side of the crops; metres from the object's centre to its ends."""


class Pinhole(NamedTuple):
    """A camera of host arrays."""

    K: np.ndarray
    world_from_cam: np.ndarray


def telephoto_rig(seed, distance):
    """Four cameras that look past the object, with K of their own, and boxes around where it is."""
    rng = np.random.default_rng(seed)
    centre = rng.normal(0, 3, 3)
    away = rng.normal(size=(4, 3))
    eyes = centre + distance * away / np.linalg.norm(away, axis=-1, keepdims=True)
    poses = np.stack([np.asarray(look_at(eye, centre + rng.normal(0, 0.02 * distance, 3))) for eye in eyes])
    K = np.zeros((4, 3, 3))
    K[:, 0, 0] = K[:, 1, 1] = rng.uniform(800, 3000, 4)
    K[:, 0, 2], K[:, 1, 2], K[:, 2, 2] = 960, 540, 1.0
    middle = np.stack([project_points(centre, Pinhole(k, p)) for k, p in zip(K, poses, strict=True)])
    reach = K[:, 0, 0] * HALF / distance
    return centre, K, poses, np.concatenate([middle - reach[:, None], middle + reach[:, None]], axis=-1)


@pytest.mark.parametrize("distance", [3.0, 40.0, 280.0])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_point_projects_identically_through_crop_and_image(seed, distance):
    centre, K, poses, boxes = telephoto_rig(seed, distance)
    crops = crop_cameras(K, poses, boxes, size=SIZE)
    points = centre + np.random.default_rng(seed + 9).uniform(-HALF, HALF, (20, 3))
    for view in range(4):
        pixels = project_points(points, Pinhole(K[view], poses[view]))
        through = np.concatenate([pixels, np.ones((20, 1))], axis=-1) @ crops.crop_from_image[view].T
        virtual = Pinhole(crops.camera.K[view], crops.camera.world_from_cam[view])
        np.testing.assert_allclose(project_points(points, virtual), through[:, :2] / through[:, 2:], atol=1e-6)


@pytest.mark.parametrize("distance", [3.0, 40.0, 280.0])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_rays_of_the_crops_meet_at_the_centre(seed, distance):
    centre, K, poses, boxes = telephoto_rig(seed, distance)
    rays = crop_cameras(K, poses, boxes, size=SIZE).ray
    with jax.enable_x64(True):
        met = np.asarray(intersect_rays(jnp.asarray(poses[:, :3, 3]), jnp.asarray(rays)))
        shifted = crop_cameras(K, poses, boxes + np.array([4.0, 0, 4.0, 0]), size=SIZE).ray
        beside = np.asarray(intersect_rays(jnp.asarray(poses[:, :3, 3]), jnp.asarray(shifted)))
    np.testing.assert_allclose(met, centre, atol=1e-6)
    assert np.linalg.norm(beside - centre) > 1e-4  # boxes beside the object look elsewhere


def test_about_the_centre_single_precision_is_enough():
    """What the reconstructor gets: float32 cameras in the crops' frame, the furthest of Table 6.8."""
    centre, K, poses, boxes = telephoto_rig(5, 280.0)
    crops = crop_cameras(K, poses, boxes, size=SIZE)
    points = np.random.default_rng(6).uniform(-HALF, HALF, (20, 3))
    for view in range(4):
        pose = crops.camera.world_from_cam[view].copy()
        exact = project_points(points + centre, Pinhole(crops.camera.K[view], pose))
        pose[:3, 3] -= centre
        single = Camera(jnp.asarray(crops.camera.K[view], jnp.float32), jnp.asarray(pose, jnp.float32), SIZE, SIZE)
        found = project_points(jnp.asarray(points, jnp.float32), single)
        np.testing.assert_allclose(found, exact, atol=0.05)
