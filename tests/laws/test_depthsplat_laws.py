"""Symmetries of DepthSplat-OC: it turns with the rig, does not see absolute size, and reads views in any order."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.depthsplat_examples import SMALL, disc_views, predict, small_depthsplat

from aerojax.core.types import Gaussians, View
from aerojax.geometry.rotations import haar_quaternion, quaternion_multiply, rotation_from_quaternion

VIEWS = 3


def of_all(views: View) -> Gaussians:
    return predict(small_depthsplat(), views, jnp.ones(VIEWS, bool)).gaussians


def shown(views: View) -> Gaussians:
    """Gaussians of all pixels that show the object."""
    gaussians = of_all(views)
    return jax.tree.map(lambda leaf: np.asarray(leaf[gaussians.opacity > 0]), gaussians)


def posed(views: View, poses: jax.Array) -> View:
    return dataclasses.replace(views, camera=dataclasses.replace(views.camera, world_from_cam=poses))


def turned(views: View, rotation: jax.Array, which: jax.Array) -> View:
    turn = jnp.eye(4).at[:3, :3].set(rotation)
    poses = views.camera.world_from_cam
    return posed(views, jnp.where(which[:, None, None], jnp.einsum("ij,vjk->vik", turn, poses), poses))


def furthest(turned_gaussians: Gaussians, gaussians: Gaussians, quaternion: jax.Array) -> float:
    """Greatest difference of means, scales and quaternions up to sign from those that are turned."""
    rotation = np.asarray(rotation_from_quaternion(quaternion))
    means = np.abs(turned_gaussians.mean - gaussians.mean @ rotation.T).max()
    own = jnp.asarray(gaussians.quaternion)
    expected = quaternion_multiply(jnp.broadcast_to(quaternion, own.shape), own)
    signed = np.sign(np.sum(np.asarray(expected) * turned_gaussians.quaternion, axis=-1, keepdims=True))
    quaternions = np.abs(signed * turned_gaussians.quaternion - np.asarray(expected)).max()
    scales = np.abs(turned_gaussians.scale - gaussians.scale).max() / gaussians.scale.max()
    return float(max(means, quaternions, scales))


@pytest.mark.parametrize("seed", [0, 1])
def test_turning_the_rig_turns_the_gaussians(seed):
    views = disc_views(VIEWS, SMALL.size)
    quaternion = haar_quaternion(key=jax.random.key(seed))
    rotation = rotation_from_quaternion(quaternion)
    before, after = shown(views), shown(turned(views, rotation, jnp.ones(VIEWS, bool)))
    assert len(before.mean) > 100 and furthest(after, before, quaternion) < 1e-4
    some = shown(turned(views, rotation, jnp.arange(VIEWS) != 1))
    assert furthest(some, before, quaternion) > 1e-2  # one camera stays where it was


def test_size_is_not_seen():
    """Everything ten times as far and as large: the same Gaussians, ten times as far and as large."""
    views = disc_views(VIEWS, SMALL.size)
    poses = views.camera.world_from_cam
    before, after = shown(views), shown(posed(views, poses.at[:, :3, 3].multiply(10.0)))
    np.testing.assert_allclose(after.mean, 10 * before.mean, atol=1e-3)
    np.testing.assert_allclose(after.scale, 10 * before.scale, rtol=1e-4)
    np.testing.assert_allclose(after.opacity, before.opacity, atol=1e-4)


def test_order_of_the_views():
    """Another order of the views orders their Gaussians otherwise, and nothing else."""
    views = disc_views(VIEWS, SMALL.size)
    order = jnp.asarray([2, 0, 1])
    before = of_all(views)
    after = of_all(jax.tree.map(lambda leaf: leaf[order], views))
    mixed = jax.tree.map(lambda leaf: leaf.reshape(VIEWS, -1, *leaf.shape[1:])[order].reshape(leaf.shape), before)
    np.testing.assert_allclose(after.mean, mixed.mean, atol=1e-4)
    np.testing.assert_allclose(after.opacity, mixed.opacity, atol=1e-4)
    assert not np.allclose(after.mean, before.mean, atol=1e-2)
