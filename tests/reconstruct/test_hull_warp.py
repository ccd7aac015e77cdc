"""The hull on the host equals its JAX twin: same cells in the same order, equal to rounding."""

from __future__ import annotations

from dataclasses import replace

import cv2
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import warp as wp
from scipy.spatial import cKDTree
from support.cut_views import cut_beyond
from support.hull_views import SIZE, mesh_views, one, rig, sphere_mask, views_of

from aerojax.core.types import SH_C0, Camera, View
from aerojax.gaussians.rotate import covariance
from aerojax.reconstruct.hull import HullConfig, cam_from_world_rows, visual_hull
from aerojax.reconstruct.hull_warp import hull_of_crops
from aerojax.simulate.assets.catalogue import identities

CONFIG = HullConfig(grid=40)
DEVICES = ["cpu", pytest.param("cuda:0", marks=pytest.mark.skipif(not wp.get_cuda_device_count(), reason="no GPU"))]
twin = jax.jit(visual_hull, static_argnames="config")


def crops(identity, views, folder):
    """A simulated object in smooth colours that differ between the views."""
    seen, _ = mesh_views(identities("test", 1)[identity], folder, rig(views))
    noise = np.random.default_rng(identity).random(seen.rgb.shape, np.float32)
    rgb = np.stack([cv2.GaussianBlur(image, (0, 0), 3.0) for image in noise])
    return View(jnp.asarray(rgb), seen.mask, seen.camera)


def assert_equals_twin(views, valid, config=CONFIG, device="cpu"):
    expected, count, cell = twin(views, jnp.asarray(valid), config=config)
    found, found_count, found_cell = hull_of_crops(views, valid, config=config, device=device)
    assert found_count == int(count) > 0
    assert found_cell == pytest.approx(float(cell), rel=1e-6)
    np.testing.assert_allclose(found.mean / cell, expected.mean / cell, atol=1e-4)
    np.testing.assert_allclose(found.scale / cell, expected.scale / cell, atol=1e-4)
    np.testing.assert_allclose(found.opacity, expected.opacity)
    np.testing.assert_allclose(covariance(found) / cell**2, covariance(expected) / cell**2, atol=1e-4)
    # The axes of a nearly round tile may turn freely.
    oblong = expected.scale[:, 0] > 1.01 * expected.scale[:, 1]
    same = np.abs(np.sum(found.quaternion * expected.quaternion, axis=1))
    assert np.mean(oblong) > 0.9 and np.min(same[oblong]) > 1 - 1e-5
    # Which bin of the visibility test a point at the bin's edge falls into is decided by rounding.
    colour = np.abs(found.sh - expected.sh).max(axis=(1, 2)) * SH_C0
    assert np.mean(colour < 1e-4) > 0.998 and colour.max() < 0.1
    return found_count


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize(("identity", "views"), [(0, 3), (1, 5), (2, 8), (3, 5)])
def test_simulated_objects(identity, views, device, tmp_path):
    assert assert_equals_twin(crops(identity, views, tmp_path), np.ones(views, bool), device=device) > 200


def test_the_default_grid_and_more_cells_than_are_kept(tmp_path):
    views = crops(3, 5, tmp_path)
    config = HullConfig(capacity=1500)
    assert assert_equals_twin(views, np.ones(5, bool), config) == 1500


def test_views_that_do_not_count(tmp_path):
    views, valid = crops(2, 5, tmp_path), np.array([True, True, False, True, True])
    views = View(views.rgb, views.mask.at[2].set(0.0), views.camera)
    assert_equals_twin(views, valid)
    assert hull_of_crops(views, np.ones(5, bool), config=CONFIG)[1] == 0


@pytest.mark.parametrize("device", DEVICES)
def test_views_that_are_cut(device, tmp_path):
    views, valid = crops(3, 5, tmp_path), np.ones(5, bool)
    cut = cut_beyond(cut_beyond(views, 1, SIZE // 2, mask=1.0), 4, 2 * SIZE // 3, colour=0.5)
    more = assert_equals_twin(cut, valid, device=device)
    assert more > 200
    everything = replace(views, known=jnp.ones(views.mask.shape, bool))  # a map that excludes nothing is none
    found, plain = (hull_of_crops(v, valid, config=CONFIG, device=device) for v in (everything, views))
    assert found[1] == plain[1] != more
    np.testing.assert_allclose(found[0].mean, plain[0].mean, atol=1e-6)


def test_cells_behind_a_wide_camera():
    """A window of more than a right angle: its cube reaches behind the cameras, where depth is kept positive."""
    narrow = rig(4)
    K = narrow.K.at[:, [0, 1], [0, 1]].set(0.4 * SIZE)
    cameras = Camera(K, narrow.world_from_cam, SIZE, SIZE)
    views, valid = views_of(cameras, lambda camera: sphere_mask(camera, 9.0)), np.ones(4, bool)
    expected, count, cell = twin(views, jnp.asarray(valid), config=CONFIG)
    found, found_count, _ = hull_of_crops(views, valid, config=CONFIG)
    assert found_count == int(count) > 200
    np.testing.assert_allclose(found.mean / cell, expected.mean / cell, atol=1e-4)


@pytest.mark.parametrize("valid", [np.zeros(4, bool), np.ones(4, bool)])
def test_an_empty_hull(valid):
    cameras = rig(4)
    masks = [sphere_mask(one(cameras, i), 0.1, (0.0, 0.0, 0.4 if i < 2 else -0.4)) for i in range(4)]
    views = View(jnp.ones((4, *masks[0].shape, 3)), jnp.stack(masks), cameras)
    found, count, _ = hull_of_crops(views, valid, config=CONFIG)
    assert count == 0 and found.mean.shape == (CONFIG.capacity, 3)
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(found))


def test_turned_cameras_turn_the_hull_and_nothing_else(tmp_path):
    """A turn that takes the grid to itself: x to y, y to z, z to x."""
    views, valid = crops(3, 5, tmp_path), np.ones(5, bool)
    turn, camera = jnp.eye(4)[jnp.array([2, 0, 1, 3])], views.camera
    turned = View(views.rgb, views.mask, Camera(camera.K, turn @ camera.world_from_cam, camera.width, camera.height))
    before, count, _ = hull_of_crops(views, valid, config=CONFIG)
    after, same, cell = hull_of_crops(turned, valid, config=CONFIG)
    assert count == same
    back = np.asarray(after.mean[:count] @ turn[:3, :3])
    gap, match = cKDTree(back).query(before.mean[:count])
    assert gap.max() < 1e-4 * cell and len(np.unique(match)) == count
    turned_back = turn[:3, :3].T @ covariance(after)[match] @ turn[:3, :3]
    np.testing.assert_allclose(turned_back / cell**2, covariance(before)[:count] / cell**2, atol=1e-4)


def test_rows_of_the_inverse_are_the_same_bits_everywhere():
    pose = np.array(rig(7).world_from_cam)
    pose[:, :3, 3] *= np.float32(3.7)
    rows = cam_from_world_rows(pose)
    np.testing.assert_array_equal(rows, jax.jit(cam_from_world_rows)(jnp.asarray(pose)))
    np.testing.assert_allclose(rows, np.linalg.inv(pose.astype(np.float64))[:, :3], atol=1e-5)
