"""Pinhole cameras by hand-computed numbers."""

from __future__ import annotations

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np

from aerojax.core.types import Camera
from aerojax.geometry.cameras import (
    invert_rigid,
    look_at,
    pixel_rays,
    pixels_of_camera_points,
    points_in_camera,
    project_points,
    unproject_depth,
)

HALF = np.sqrt(0.5)


def camera(world_from_cam=None, skew_px=0.0):
    K = jnp.array([[100.0, skew_px, 32.0], [0.0, 200.0, 24.0], [0.0, 0.0, 1.0]])
    return Camera(K, jnp.eye(4) if world_from_cam is None else world_from_cam, 64, 48)


@dataclass(frozen=True)
class HostCamera:
    """A pinhole of host arrays, as cameras of captures are."""

    K: np.ndarray
    world_from_cam: np.ndarray


def host_camera(world_from_cam=None):
    K = np.array([[100.0, 0.0, 32.0], [0.0, 200.0, 24.0], [0.0, 0.0, 1.0]])
    return HostCamera(K, np.eye(4) if world_from_cam is None else world_from_cam)


def test_projection_by_hand():
    points = jnp.array([[0.0, 0.0, 5.0], [1.0, -0.5, 4.0]])
    np.testing.assert_allclose(project_points(points, camera()), [[32.0, 24.0], [57.0, -1.0]], atol=1e-5)
    # Skew adds skew·Y/Z to u alone.
    np.testing.assert_allclose(project_points(points[1], camera(skew_px=8.0)), [56.0, -1.0], atol=1e-5)


def test_unprojection_by_hand():
    point = unproject_depth(jnp.array([57.0, -1.0]), jnp.array(4.0), camera())
    np.testing.assert_allclose(point, [1.0, -0.5, 4.0], atol=1e-6)
    ray = pixel_rays(jnp.array([[132.0, 24.0]]), camera())
    np.testing.assert_allclose(ray, [[HALF, 0.0, HALF]], atol=1e-6)


def test_look_at_from_the_south():
    # From y = -10 north to the origin: right is east (+X), down is -Z, forward +Y.
    pose = look_at(jnp.array([0.0, -10.0, 0.0]), jnp.zeros(3))
    expected = [[1, 0, 0, 0], [0, 0, 1, -10], [0, -1, 0, 0], [0, 0, 0, 1]]
    np.testing.assert_allclose(pose, expected, atol=1e-6)
    above = project_points(jnp.array([0.0, 0.0, 1.0]), camera(pose))
    np.testing.assert_allclose(above, [32.0, 4.0], atol=1e-5)


def test_looking_straight_up_has_its_up_towards_x():
    for side in (1.0, -1.0):
        pose = look_at(jnp.array([0.0, 0.0, -5.0 * side]), jnp.zeros(3))
        np.testing.assert_allclose(pose[:3, 1:3].T, [[-1, 0, 0], [0, 0, side]], atol=1e-6)


def test_what_is_behind_a_camera_has_no_pixel():
    points = np.array([[0.0, 0.0, 5.0], [1.0, -0.5, -4.0], [1.0, 1.0, 0.0]])
    pixels = project_points(points, host_camera(), behind=np.nan)
    np.testing.assert_array_equal(pixels, [[32.0, 24.0], [np.nan, np.nan], [np.nan, np.nan]])
    assert np.isfinite(project_points(points, host_camera())).all()


def test_host_arrays_stay_on_the_host_and_in_double_precision(x64):
    """NumPy in, NumPy out; the numbers are those of JAX."""
    pose = look_at(np.array([3.0, -10.0, 2.0]), np.array([0.1, 0.2, 0.3]))
    on_host, on_device = host_camera(pose), camera(jnp.asarray(pose))
    points = np.array([[0.5, 0.0, 1.0], [0.0, -0.5, 0.25]])
    pixels = project_points(points, on_host)
    calls = {
        look_at: (np.array([3.0, -10.0, 2.0]), np.array([0.1, 0.2, 0.3])),
        invert_rigid: (pose,),
        points_in_camera: (points, on_host),
        pixels_of_camera_points: (points + 5.0, on_host),
        project_points: (points, on_host),
        pixel_rays: (pixels, on_host),
        unproject_depth: (pixels, np.array([4.0, 5.0]), on_host),
    }
    for function, arguments in calls.items():
        here = function(*arguments)
        there = function(*(on_device if a is on_host else jnp.asarray(a) for a in arguments))
        assert type(here) is np.ndarray and here.dtype == np.float64 and isinstance(there, jax.Array)
        np.testing.assert_allclose(here, there, rtol=1e-12, atol=1e-12)


def test_invert_rigid_by_hand():
    quarter = [[0.0, -1.0, 0.0, 1.0], [1.0, 0.0, 0.0, 2.0], [0.0, 0.0, 1.0, 3.0], [0.0, 0.0, 0.0, 1.0]]
    expected = [[0, 1, 0, -2], [-1, 0, 0, 1], [0, 0, 1, -3], [0, 0, 0, 1]]
    np.testing.assert_allclose(invert_rigid(jnp.array(quarter)), expected, atol=1e-6)
