"""Geometry by hand-computed numbers."""

from __future__ import annotations

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from aerojax.core.types import Camera
from aerojax.geometry.boxes import box_iou, projected_box, tight_box, touches_border
from aerojax.geometry.cameras import (
    invert_rigid,
    look_at,
    pixel_rays,
    pixels_of_camera_points,
    points_in_camera,
    project_points,
    unproject_depth,
)
from aerojax.geometry.covariances import axes_from_covariance, covariance_from_axes
from aerojax.geometry.rotations import (
    canonical_sign,
    normalise,
    quaternion_from_rotation,
    quaternion_multiply,
    rotation_about_z,
    rotation_between,
    rotation_from_quaternion,
    skew,
)
from aerojax.geometry.triangulation import intersect_rays

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


def test_projected_box_by_hand():
    points = np.array([[0.0, 0.0, 5.0], [1.0, -0.5, 4.0]])
    assert projected_box(points, host_camera()) == (32.0, -1.0, 57.0, 24.0)
    assert projected_box(-points, host_camera()) is None


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


def test_quaternions_by_hand():
    quarter_z = jnp.array([HALF, 0.0, 0.0, HALF])
    expected = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    np.testing.assert_allclose(rotation_from_quaternion(quarter_z), expected, atol=1e-6)
    np.testing.assert_allclose(rotation_from_quaternion(-3.0 * quarter_z), expected, atol=1e-6)
    np.testing.assert_allclose(rotation_about_z(jnp.array(np.pi / 2)), expected, atol=1e-6)
    half_z = quaternion_multiply(quarter_z, quarter_z)
    np.testing.assert_allclose(half_z, [0, 0, 0, 1], atol=1e-6)
    # i ⊗ j = k, j ⊗ i = -k
    i, j = jnp.array([0.0, 1.0, 0.0, 0.0]), jnp.array([0.0, 0.0, 1.0, 0.0])
    np.testing.assert_allclose(quaternion_multiply(i, j), [0, 0, 0, 1])
    np.testing.assert_allclose(quaternion_multiply(j, i), [0, 0, 0, -1])


@pytest.mark.parametrize(
    ("diagonal", "quaternion"),
    [
        ((1, 1, 1), (1, 0, 0, 0)),
        ((1, -1, -1), (0, 1, 0, 0)),
        ((-1, 1, -1), (0, 0, 1, 0)),
        ((-1, -1, 1), (0, 0, 0, 1)),
    ],
)
def test_each_branch_of_shepperd(diagonal, quaternion):
    np.testing.assert_allclose(quaternion_from_rotation(jnp.diag(jnp.array(diagonal, jnp.float32))), quaternion)


def test_canonical_sign_keeps_half_turns():
    halves = jnp.array([[0.0, -1.0, 0.0, 0.0], [-0.6, 0.8, 0.0, 0.0], [0.6, -0.8, 0.0, 0.0]])
    np.testing.assert_allclose(canonical_sign(halves), [[0, -1, 0, 0], [0.6, -0.8, 0, 0], [0.6, -0.8, 0, 0]], atol=1e-7)


def test_zero_is_handled():
    np.testing.assert_array_equal(normalise(jnp.zeros(3)), np.zeros(3))
    np.testing.assert_allclose(rotation_from_quaternion(jnp.zeros(4)), np.eye(3))


def test_skew_is_the_cross_product():
    v, u = jnp.array([1.0, 2.0, 3.0]), jnp.array([-2.0, 0.5, 4.0])
    np.testing.assert_allclose(skew(v) @ u, [6.5, -10.0, 4.5])


def test_rotation_between_by_hand():
    x, y = jnp.array([1.0, 0.0, 0.0]), jnp.array([0.0, 1.0, 0.0])
    np.testing.assert_allclose(rotation_between(x, y), [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-6)
    np.testing.assert_allclose(rotation_between(x, x), np.eye(3), atol=1e-6)
    assert np.isfinite(rotation_between(x, -x)).all()


def test_covariance_by_hand():
    sigma = covariance_from_axes(jnp.array([HALF, 0.0, 0.0, HALF]), jnp.array([2.0, 1.0, 0.5]))
    np.testing.assert_allclose(sigma, np.diag([1.0, 4.0, 0.25]), atol=1e-6)
    _, scale = axes_from_covariance(jnp.diag(jnp.array([1.0, 4.0, 0.25])))
    np.testing.assert_allclose(scale, [2.0, 1.0, 0.5], rtol=1e-6)


def test_rounding_below_zero_becomes_a_flat_axis():
    _, scale = axes_from_covariance(jnp.diag(jnp.array([1.0, 0.25, -1e-9])))
    np.testing.assert_allclose(scale, [1.0, 0.5, 0.0], atol=1e-6)


def test_triangulation_by_hand():
    origins = jnp.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [5.0, 5.0, 5.0]])
    directions = jnp.array([[HALF, HALF, 0.0], [-HALF, HALF, 0.0], [0.0, 0.0, 1.0]])
    weights = jnp.array([1.0, 1.0, 0.0])
    np.testing.assert_allclose(intersect_rays(origins, directions, weights), [1.0, 1.0, 0.0], atol=1e-5)
    assert float(jnp.linalg.norm(intersect_rays(origins, directions) - jnp.array([1.0, 1.0, 0.0]))) > 0.5


def test_skew_lines_meet_half_way():
    origins = jnp.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    directions = jnp.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    np.testing.assert_allclose(intersect_rays(origins, directions), [0.0, 0.0, 0.5], atol=1e-6)


def test_boxes():
    mask = np.zeros((6, 8), bool)
    assert tight_box(mask) is None
    mask[2:4, 3:7] = True
    assert tight_box(mask) == (3.0, 2.0, 7.0, 4.0)
    assert tight_box(mask, min_pixels=9) is None
    assert box_iou((0.0, 0.0, 2.0, 2.0), (1.0, 1.0, 3.0, 3.0)) == pytest.approx(1 / 7)
    assert box_iou((0.0, 0.0, 1.0, 1.0), (1.0, 0.0, 2.0, 1.0)) == 0.0
    assert box_iou((0.0, 0.0, 1.0, 1.0), (5.0, 5.0, 6.0, 6.0)) == 0.0
    assert not touches_border((1.0, 1.0, 7.0, 5.0), 8, 6)
    for box in ((0.0, 1.0, 7.0, 5.0), (1.0, 0.0, 7.0, 5.0), (1.0, 1.0, 8.0, 5.0), (1.0, 1.0, 7.0, 6.0)):
        assert touches_border(box, 8, 6)


@pytest.mark.parametrize(
    ("function", "at"),
    [
        (normalise, np.zeros(3)),
        (rotation_from_quaternion, np.zeros(4)),
        (lambda p: project_points(p, camera()), np.zeros(3)),
        (lambda p: rotation_between(p, jnp.array([0.0, 0.0, 1.0])), np.array([0.0, 0.0, 1.0])),
        (lambda p: rotation_between(p, jnp.array([0.0, 0.0, 1.0])), np.array([0.0, 0.0, -1.0])),
        (quaternion_from_rotation, np.eye(3)),
        (quaternion_from_rotation, np.diag([1.0, -1.0, -1.0])),
    ],
)
def test_gradients_are_finite_where_things_degenerate(function, at):
    gradient = jax.grad(lambda v: jnp.sum(function(v) ** 2 + function(v)))(jnp.asarray(at, jnp.float32))
    assert np.isfinite(gradient).all()
