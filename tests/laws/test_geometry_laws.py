"""Laws of geometry: inverses, the double cover, Haar measure."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

from aerojax.core.types import Camera
from aerojax.geometry.cameras import (
    invert_rigid,
    look_at,
    pixel_rays,
    points_in_camera,
    project_points,
    transform_points,
    unproject_depth,
)
from aerojax.geometry.covariances import axes_from_covariance, covariance_from_axes
from aerojax.geometry.rotations import (
    haar_quaternion,
    haar_rotation,
    quaternion_from_rotation,
    quaternion_multiply,
    rotation_between,
    rotation_from_quaternion,
)
from aerojax.geometry.triangulation import intersect_rays


def draw(*shape, seed=0):
    return np.random.default_rng(seed).normal(size=shape)


def rigid(seed):
    pose = np.eye(4)
    pose[:3, :3] = Rotation.random(random_state=seed).as_matrix()
    pose[:3, 3] = 300.0 * draw(3, seed=seed)
    return jnp.asarray(pose)


def a_camera(seed):
    K = jnp.array([[900.0, 1.5, 480.3], [0.0, 880.0, 270.7], [0.0, 0.0, 1.0]])
    return Camera(K, rigid(seed), 960, 540)


@pytest.mark.parametrize("seed", range(3))
def test_projection_undoes_unprojection(x64, seed):
    rng = np.random.default_rng(seed)
    pixels, depth = jnp.asarray(rng.uniform(0, 960, (200, 2))), jnp.asarray(rng.uniform(0.5, 500, 200))
    camera = a_camera(seed)
    points = unproject_depth(pixels, depth, camera)
    np.testing.assert_allclose(project_points(points, camera), pixels, atol=1e-9, rtol=1e-10)
    np.testing.assert_allclose(points_in_camera(points, camera)[:, 2], depth, rtol=1e-10)
    again = unproject_depth(project_points(points, camera), depth, camera)
    np.testing.assert_allclose(again, points, atol=1e-10 * 1000)


def test_pixel_rays_pass_through_unprojected_points(x64):
    camera, pixels = a_camera(5), jnp.array([[10.0, 500.0], [800.0, 3.0]])
    away = unproject_depth(pixels, jnp.array([7.0, 90.0]), camera) - camera.world_from_cam[None, :3, 3]
    away = away / jnp.linalg.norm(away, axis=-1, keepdims=True)
    np.testing.assert_allclose(pixel_rays(pixels, camera), away, atol=1e-12)


def test_invert_rigid_is_the_inverse(x64):
    poses = jnp.stack([rigid(seed) for seed in range(5)])
    np.testing.assert_allclose(invert_rigid(poses), np.linalg.inv(poses), atol=1e-10)
    points = jnp.asarray(draw(20, 3))
    there = transform_points(poses[0], points)
    np.testing.assert_allclose(transform_points(invert_rigid(poses[0]), there), points, atol=1e-10)


def test_look_at_is_rigid_upright_and_centred(x64):
    for seed in range(5):
        centre, target = jnp.asarray(50 * draw(3, seed=seed)), jnp.asarray(draw(3, seed=seed + 50))
        pose = look_at(centre, target)
        np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-12)
        assert float(jnp.linalg.det(pose[:3, :3])) == pytest.approx(1.0)
        in_camera = points_in_camera(
            jnp.stack([target, target + jnp.array([0.0, 0.0, 1.0])]), Camera(jnp.eye(3), pose, 1, 1)
        )
        np.testing.assert_allclose(in_camera[0, :2], 0.0, atol=1e-10)
        assert in_camera[0, 2] > 0 and in_camera[1, 1] < in_camera[0, 1]
        assert float(pose[2, 0]) == pytest.approx(0.0, abs=1e-12), "the image's rows are level"


def test_quaternions_and_rotations_round_trip(x64):
    # Each of the four components largest, both signs: every branch of Shepperd's method.
    quaternions = draw(400, 4)
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    assert set(np.argmax(np.abs(quaternions), axis=1)) == {0, 1, 2, 3}
    both = jnp.asarray(np.concatenate([quaternions, -quaternions]))
    rotation = rotation_from_quaternion(both)
    np.testing.assert_allclose(rotation[:400], rotation[400:], atol=1e-15)
    back = quaternion_from_rotation(rotation)
    assert float(back[:, 0].min()) >= 0.0
    np.testing.assert_allclose(np.abs(np.sum(np.asarray(back * both), axis=1)), 1.0, atol=1e-12)
    np.testing.assert_allclose(rotation_from_quaternion(back), rotation, atol=1e-12)
    reference = Rotation.from_quat(quaternions[:, [1, 2, 3, 0]]).as_matrix()
    np.testing.assert_allclose(rotation[:400], reference, atol=1e-12)


def test_products_of_quaternions_are_products_of_rotations(x64):
    a, b = jnp.asarray(draw(30, 4, seed=1)), jnp.asarray(draw(30, 4, seed=2))
    product = rotation_from_quaternion(a) @ rotation_from_quaternion(b)
    np.testing.assert_allclose(rotation_from_quaternion(quaternion_multiply(a, b)), product, atol=1e-12)


def test_haar_rotations_are_rotations():
    turns = jax.vmap(lambda k: haar_rotation(key=k))(jax.random.split(jax.random.key(0), 500))
    unit = jnp.broadcast_to(jnp.eye(3), turns.shape)
    np.testing.assert_allclose(turns @ jnp.swapaxes(turns, -1, -2), unit, atol=2e-6)
    np.testing.assert_allclose(jnp.linalg.det(turns), 1.0, atol=2e-6)


def test_haar_rotations_are_uniform():
    keys = jax.random.split(jax.random.key(1), 4000)
    turns = np.asarray(jax.vmap(lambda k: haar_rotation(key=k))(keys))
    # Each entry has mean 0 and variance 1/3: four standard errors of 4000 draws are 0.037.
    assert np.abs(turns.mean(axis=0)).max() < 4 * np.sqrt(1 / 3 / 4000)
    # Every column is uniform on the sphere, so (Archimedes) every entry is uniform in -1..1.
    assert min(stats.kstest(turns[:, i, j], "uniform", (-1, 2)).pvalue for i in range(3) for j in range(3)) > 1e-3
    # The angle's density is (1 - cos θ)/π; small angles are rare, unlike for uniform angle and axis.
    angle = np.arccos(np.clip((np.trace(turns, axis1=1, axis2=2) - 1) / 2, -1, 1))
    assert stats.kstest(angle, lambda t: (t - np.sin(t)) / np.pi).pvalue > 1e-3


def test_the_uniformity_check_can_fail():
    angle = np.random.default_rng(0).uniform(0, np.pi, 4000)
    assert stats.kstest(angle, lambda t: (t - np.sin(t)) / np.pi).pvalue < 1e-12


def test_haar_quaternions_have_one_sign():
    quaternions = jax.vmap(lambda k: haar_quaternion(key=k))(jax.random.split(jax.random.key(2), 100))
    assert float(quaternions[:, 0].min()) >= 0.0
    np.testing.assert_allclose(jnp.linalg.norm(quaternions, axis=1), 1.0, rtol=1e-6)


def test_rotation_between_is_minimal(x64):
    pairs = draw(2, 100, 3)
    a, b = pairs / np.linalg.norm(pairs, axis=-1, keepdims=True)
    turn = rotation_between(jnp.asarray(a), jnp.asarray(b))
    np.testing.assert_allclose(np.einsum("nij,nj->ni", turn, a), b, atol=1e-12)
    np.testing.assert_allclose(
        np.einsum("nij,nkj->nik", turn, turn), np.broadcast_to(np.eye(3), (100, 3, 3)), atol=1e-9
    )
    angle = np.arccos(np.clip((np.trace(turn, axis1=1, axis2=2) - 1) / 2, -1, 1))
    np.testing.assert_allclose(angle, np.arccos(np.clip(np.sum(a * b, axis=1), -1, 1)), atol=1e-6)


def test_axes_of_covariances_round_trip(x64):
    quaternion, scale = jnp.asarray(draw(60, 4)), jnp.asarray(np.exp(draw(60, 3)))
    sigma = covariance_from_axes(quaternion, scale)
    axes, deviations = axes_from_covariance(sigma)
    np.testing.assert_allclose(covariance_from_axes(axes, deviations), sigma, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(deviations, -np.sort(-np.asarray(scale), axis=1), rtol=1e-9)
    np.testing.assert_allclose(covariance_from_axes(-quaternion, scale), sigma, atol=1e-12)


def test_triangulation_is_exact_and_moves_with_the_world(x64):
    target, origins = jnp.asarray([120.0, -40.0, 33.0]), jnp.asarray(80.0 * draw(5, 3))
    directions = target[None] - origins
    directions = directions / jnp.linalg.norm(directions, axis=1, keepdims=True)
    np.testing.assert_allclose(intersect_rays(origins, directions), target, atol=1e-9)
    np.testing.assert_allclose(intersect_rays(origins, -directions), target, atol=1e-9)
    noisy = directions + 0.01 * draw(5, 3, seed=3)
    noisy = noisy / jnp.linalg.norm(noisy, axis=1, keepdims=True)
    pose = rigid(8)
    moved = intersect_rays(transform_points(pose, origins), noisy @ pose[:3, :3].T)
    np.testing.assert_allclose(moved, transform_points(pose, intersect_rays(origins, noisy)), atol=1e-9)


def test_weight_zero_removes_a_ray(x64):
    origins = jnp.asarray(10.0 * draw(4, 3))
    directions = jnp.asarray(draw(4, 3, seed=4))
    directions = directions / jnp.linalg.norm(directions, axis=1, keepdims=True)
    without = intersect_rays(origins[:3], directions[:3])
    weights = jnp.array([1.0, 1.0, 1.0, 0.0])
    np.testing.assert_allclose(intersect_rays(origins, directions, weights), without, atol=1e-10)
    np.testing.assert_allclose(intersect_rays(origins, directions, 7.0 * weights), without, atol=1e-10)
