"""The visual hull: contains the object, hugs it, keeps thin parts, ignores what is not valid."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial import cKDTree
from support.cut_views import cut_beyond
from support.hull_views import HALF_WIDTH, SIZE, mesh_views, one, rig, rod_mask, sphere_mask, views_of

from aerojax.core.types import SH_C0, View
from aerojax.gaussians.rotate import covariance
from aerojax.geometry.cameras import project_points
from aerojax.geometry.rotations import rotation_from_quaternion
from aerojax.reconstruct.hull import HullConfig, visual_hull
from aerojax.simulate.assets.catalogue import identities

CONFIG = HullConfig(grid=40, capacity=4096)


@partial(jax.jit, static_argnames="config")
def hull(views, valid, config=CONFIG):
    return visual_hull(views, valid, config=config)


def real(gaussians, count):
    return jax.tree.map(lambda leaf: np.asarray(leaf[: int(count)]), gaussians)


@pytest.mark.parametrize("views", [4, 6])
def test_the_hull_hugs_and_contains_a_sphere(views):
    radius = 0.4
    seen = views_of(rig(views), partial(sphere_mask, radius=radius))
    gaussians, count, cell = hull(seen, jnp.ones(views, bool))
    found, cell = real(gaussians, count), float(cell)
    assert 200 < int(count) <= CONFIG.capacity
    distance = np.linalg.norm(found.mean, axis=1)
    pixel = HALF_WIDTH * 2 / SIZE
    assert distance.min() > radius - pixel  # no Gaussian inside the object
    assert np.quantile(distance, 0.1) < radius + CONFIG.dilation * cell + pixel  # where cameras touch it, it is tight
    assert distance.max() < 2.0 * radius  # four to six cameras leave corners, not spikes
    outward = np.sum(
        found.mean / distance[:, None] * rotation_from_quaternion(jnp.asarray(found.quaternion))[:, :, 2], 1
    )
    assert np.median(outward) > 0.85 and np.mean(outward > 0) > 0.97  # the third axis points away from the object
    # Every true surface point is inside: below the hull's surface along its own direction.
    tree = cKDTree(found.mean / distance[:, None])
    directions = np.random.default_rng(0).normal(size=(300, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    above = distance[tree.query(directions)[1]]
    assert np.mean(above > radius) > 0.99


def test_colours_of_the_surface():
    views = views_of(rig(5), partial(sphere_mask, radius=0.4))
    found = real(*hull(views, jnp.ones(5, bool))[:2])
    rgb = found.sh[:, 0] * SH_C0 + 0.5
    np.testing.assert_allclose(np.median(rgb, axis=0), [0.2, 0.5, 0.7], atol=0.01)
    assert np.quantile(np.abs(rgb - [0.2, 0.5, 0.7]).max(axis=1), 0.9) < 0.12
    np.testing.assert_allclose(found.opacity, CONFIG.opacity)


def test_gaussians_are_flat_tiles_of_about_a_cell():
    gaussians, count, cell = hull(views_of(rig(5), partial(sphere_mask, radius=0.4)), jnp.ones(5, bool))
    found = real(gaussians, count)
    thickness = found.scale[:, 2] / float(cell)
    assert thickness.min() > 0.14 and np.median(thickness) < 0.4
    assert (found.scale[:, 2] <= found.scale[:, 0] * 1.001).mean() > 0.95
    assert found.scale.max() < 2.0 * float(cell)
    values = np.linalg.eigvalsh(covariance(gaussians)[: int(count)])
    assert values.min() > 0


def test_a_thin_rod_survives():
    ends = jnp.array([[-0.45, -0.1, 0.05], [0.45, 0.12, -0.06]])
    pixel = 2 * HALF_WIDTH / SIZE
    gaussians, count, cell = hull(views_of(rig(5), lambda c: rod_mask(c, ends, 0.55 * pixel)), jnp.ones(5, bool))
    found = real(gaussians, count)
    assert int(count) > 20
    axis = np.asarray(ends[1] - ends[0])
    along = (found.mean - np.asarray(ends[0])) @ axis / (axis @ axis)
    gap = np.linalg.norm(found.mean - np.asarray(ends[0]) - along[:, None] * axis, axis=1)
    assert np.quantile(gap, 0.9) < 2.0 * float(cell)
    filled = np.histogram(along, bins=12, range=(0, 1))[0]
    assert (filled[1:-1] > 0).all()  # unbroken


def test_an_invalid_view_constrains_nothing():
    views, valid = views_of(rig(5), partial(sphere_mask, radius=0.4)), jnp.array([True, True, True, True, False])
    good, count, _ = hull(views, valid)
    spoilt = View(views.rgb.at[4].set(0.0), views.mask.at[4].set(0.0), views.camera)
    same, count_spoilt, _ = hull(spoilt, valid)
    assert int(count) == int(count_spoilt) > 0
    for a, b in zip(jax.tree.leaves(good), jax.tree.leaves(same), strict=True):
        np.testing.assert_array_equal(a, b)
    assert int(hull(spoilt, jnp.ones(5, bool))[1]) == 0  # the same view, taken for true, empties the hull


def test_silhouettes_that_do_not_meet_leave_nothing():
    cameras = rig(4)
    masks = [sphere_mask(one(cameras, i), 0.1, (0.0, 0.0, 0.4 if i < 2 else -0.4)) for i in range(4)]
    views = View(jnp.ones((4, SIZE, SIZE, 3)), jnp.stack(masks), cameras)
    gaussians, count, _ = hull(views, jnp.ones(4, bool))
    assert int(count) == 0
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(gaussians))


@pytest.mark.parametrize("index", range(4))
def test_the_hull_contains_simulated_meshes(index, tmp_path):
    views, vertices = mesh_views(identities("test", 1)[index], tmp_path, rig(5))
    gaussians, count, cell = hull(views, jnp.ones(5, bool))
    found = real(gaussians, count)
    normals = np.asarray(rotation_from_quaternion(jnp.asarray(found.quaternion)))[:, :, 2]
    _, nearest = cKDTree(found.mean).query(vertices)
    above = np.sum((vertices - found.mean[nearest]) * normals[nearest], axis=1)
    # A tip thinner than a quarter of a pixel is in no mask; all else lies below the nearest surface Gaussian.
    assert np.mean(above < 0.75 * float(cell)) > 0.98
    assert np.quantile(above, 0.9) < 0.25 * float(cell)
    outside = cKDTree(vertices).query(found.mean)[0]
    assert np.median(outside) < 4 * float(cell)  # and the surface is the object's, not a larger body's


def test_padding_repeats_the_first_and_capacity_thins_evenly():
    views, valid = views_of(rig(5), partial(sphere_mask, radius=0.4)), jnp.ones(5, bool)
    gaussians, count, _ = hull(views, valid)
    assert int(count) < CONFIG.capacity
    np.testing.assert_array_equal(
        gaussians.mean[int(count) :], np.broadcast_to(gaussians.mean[0], (CONFIG.capacity - int(count), 3))
    )
    few, kept, cell = hull(views, valid, HullConfig(grid=40, capacity=300))
    assert int(kept) == 300 and len(np.unique(few.mean, axis=0)) == 300
    gap = cKDTree(few.mean).query(gaussians.mean[: int(count)])[0]
    assert gap.max() < 8 * float(cell)


def test_the_order_of_views_does_not_matter():
    views, valid = views_of(rig(5), partial(sphere_mask, radius=0.3, centre=(0.1, 0.05, -0.1))), jnp.ones(5, bool)
    order = jnp.array([3, 1, 4, 0, 2])
    one_way, other_way = hull(views, valid)[0], hull(jax.tree.map(lambda leaf: leaf[order], views), valid)[0]
    np.testing.assert_allclose(one_way.mean, other_way.mean, atol=1e-5)
    np.testing.assert_allclose(covariance(one_way), covariance(other_way), atol=1e-6)


def test_a_cut_view_cuts_where_it_sees_and_nowhere_else():
    """A ball in four views, one of which ends at its middle."""
    whole = views_of(rig(4), partial(sphere_mask, radius=0.4))
    cut = cut_beyond(whole, 3, SIZE // 2)
    others, everyone = jnp.arange(4) < 3, jnp.ones(4, bool)
    found = real(*hull(cut, everyone)[:2]).mean
    without, with_it = real(*hull(whole, others)[:2]).mean, real(*hull(whole, everyone)[:2]).mean
    column = np.asarray(project_points(jnp.asarray(found), one(whole.camera, 3)))[:, 0]
    edge = 8.0  # pixels, three cells: coarse cells belong to one side, and moments reach across
    seen, unseen = found[column < SIZE / 2 - edge], found[column > SIZE / 2 + edge]
    assert len(seen) > 100 and len(unseen) > 100
    assert cKDTree(with_it).query(seen)[0].max() < 1e-5 > cKDTree(without).query(unseen)[0].max()
    far = [cKDTree(other).query(part)[0].max() for other, part in ((without, seen), (with_it, unseen))]
    assert min(far) > 0.02  # negative control: the fourth view tells something on both sides
    naive = hull(replace(cut, known=None), everyone)[0].mean  # the border taken for an outline cuts the ball in two
    assert cKDTree(np.asarray(naive)).query(unseen)[0].max() > 0.2


def test_what_one_view_alone_sees_is_not_kept():
    views, valid = views_of(rig(4), partial(sphere_mask, radius=0.4)), jnp.arange(4) < 3
    cut = cut_beyond(cut_beyond(views, 1, SIZE // 2), 2, SIZE // 2)
    found, count, _ = hull(cut, valid)
    points = real(found, count).mean
    cameras = [one(views.camera, i) for i in (1, 2)]
    columns = np.stack([np.asarray(project_points(jnp.asarray(points), camera))[:, 0] for camera in cameras])
    assert int(count) > 50 and (columns.min(axis=0) < SIZE / 2 + 3).all()
    nothing = jnp.ones(views.mask.shape, bool).at[1:].set(False)
    assert int(hull(replace(cut, known=nothing), valid)[1]) == 0


def test_a_cut_view_gives_no_colour_beyond_its_border():
    views = views_of(rig(4), partial(sphere_mask, radius=0.4))
    cut = cut_beyond(views, 3, SIZE // 2, colour=9.0)
    found = real(*hull(cut, jnp.ones(4, bool))[:2])
    assert (found.sh[:, 0] * SH_C0 + 0.5).max() < 1.5
