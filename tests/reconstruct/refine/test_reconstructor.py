"""The refined hull: what it does before training, its symmetries, and views that are missing, empty or wrong."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from aerojax.core.errors import UserError
from aerojax.core.types import Camera, Gaussians
from aerojax.geometry.rotations import haar_quaternion, quaternion_multiply, rotation_from_quaternion
from aerojax.reconstruct.base import TrainableReconstructor
from aerojax.reconstruct.hull import visual_hull
from aerojax.reconstruct.refine.config import RefineConfig
from aerojax.reconstruct.refine.feedback import resized
from aerojax.reconstruct.refine.parameters import gaussians_of, parameters_of
from aerojax.reconstruct.refine.reconstructor import refined
from tests.support.cut_views import cut_beyond
from tests.support.hull_views import rig, rod_mask, views_of
from tests.support.refined_hulls import SMALL, busy, sphere_views

ALL = jnp.ones(5, bool)


@jax.jit
def hull_of(views):
    return visual_hull(views, ALL, config=SMALL.hull)[:2]


@pytest.fixture(scope="module")
def hull():
    """The small configuration's hull of the ball."""
    return hull_of(sphere_views())


@jax.jit
def answer(member, views, valid):
    return member(views, valid)


@jax.jit
def all_steps(member, views):
    return member.steps(views, ALL)


@jax.jit
def final(network, start, real, views, valid):
    return refined(network, start, real, views, valid, SMALL)[-1]


def largest_difference(one, other):
    return max(float(jnp.max(jnp.abs(a - b))) for a, b in zip(one, other, strict=True))


def distinct_columns(gaussians):
    """Attributes without the quaternion's sign."""
    products = gaussians.quaternion[:, :, None] * gaussians.quaternion[:, None, :]
    return gaussians.mean, products, gaussians.scale, gaussians.opacity, gaussians.sh


def test_untrained_is_the_hull(hull):
    member = SMALL.untrained(key=jax.random.key(0))
    assert isinstance(member, TrainableReconstructor)
    found, count = answer(member, sphere_views(), ALL)
    assert 100 < int(count) == int(hull[1])
    for got, wanted in zip(jax.tree.leaves(found), jax.tree.leaves(hull[0]), strict=True):
        np.testing.assert_allclose(got, wanted, rtol=2e-6, atol=2e-6)


@pytest.mark.long
def test_steps_begin_with_the_hull_and_end_with_the_answer(hull):
    member = busy()
    steps = all_steps(member, sphere_views())
    found, count = answer(member, sphere_views(), ALL)
    assert len(steps) == SMALL.updates + 1
    real = np.arange(SMALL.capacity) < int(count)
    np.testing.assert_array_equal(steps[0].mean, hull[0].mean)
    np.testing.assert_array_equal(steps[0].opacity, np.where(real, hull[0].opacity, 0.0))
    np.testing.assert_allclose(steps[-1].columns()[: int(count)], found.columns()[: int(count)], atol=1e-6)
    for step in steps:
        assert np.all(np.asarray(step.opacity)[~real] == 0)
    np.testing.assert_array_equal(found.mean[int(count) :], np.broadcast_to(found.mean[0], (sum(~real), 3)))


def test_turning_the_rig_turns_the_gaussians(hull):
    start, count = hull
    views, real = resized(sphere_views(), SMALL.image), jnp.arange(SMALL.capacity) < count
    turn = haar_quaternion(key=jax.random.key(5))
    rotation = rotation_from_quaternion(turn)

    def rotated(gaussians):
        quaternion = quaternion_multiply(jnp.broadcast_to(turn[None], gaussians.quaternion.shape), gaussians.quaternion)
        return replace(gaussians, mean=gaussians.mean @ rotation.T, quaternion=quaternion)

    pose = views.camera.world_from_cam
    turned_pose = pose.at[:, :3].set(rotation[None] @ pose[:, :3])
    turned_views = replace(views, camera=replace(views.camera, world_from_cam=turned_pose))
    network = busy().network
    plain = final(network, start, real, views, ALL)
    turned = final(network, rotated(start), real, turned_views, ALL)
    wanted = distinct_columns(rotated(plain))
    assert largest_difference(distinct_columns(plain), distinct_columns(start)) > 1e-2  # there is something to turn
    assert largest_difference(distinct_columns(turned), wanted) < 1e-4
    left = final(network, start, real, turned_views, ALL)  # negative control: the cameras alone
    assert largest_difference(distinct_columns(left), wanted) > 1e-2


def test_order_of_the_views_does_not_matter(hull):
    start, count = hull
    views, real = resized(sphere_views(), SMALL.image), jnp.arange(SMALL.capacity) < count
    network, order = busy().network, jnp.array([2, 0, 4, 3, 1])
    one = final(network, start, real, views, ALL)
    other = final(network, start, real, jax.tree.map(lambda x: x[order], views), ALL)
    assert largest_difference(distinct_columns(one), distinct_columns(other)) < 1e-4


def test_views_that_do_not_count_change_nothing():
    """Three of five views, whatever the others hold."""
    views, member = sphere_views(), busy()
    valid = jnp.arange(5) < 3
    poison = replace(views, rgb=views.rgb.at[3:].set(7.0), mask=views.mask.at[3:].set(1.0))
    plain, count = answer(member, views, valid)
    poisoned, same = answer(member, poison, valid)
    assert 0 < int(count) == int(same)
    assert largest_difference(distinct_columns(plain), distinct_columns(poisoned)) < 1e-5
    everything, _ = answer(member, views, ALL)
    assert largest_difference(distinct_columns(plain), distinct_columns(everything)) > 1e-2


@pytest.mark.long
def test_a_cut_view_counts_and_what_lies_beyond_its_border_does_not():
    views, member = sphere_views(), busy()
    plain, count = answer(member, cut_beyond(views, 3, 48), ALL)
    poisoned, same = answer(member, cut_beyond(views, 3, 48, colour=7.0, mask=1.0), ALL)
    assert 50 < int(count) == int(same)
    assert largest_difference(distinct_columns(plain), distinct_columns(poisoned)) < 1e-5
    without, _ = answer(member, cut_beyond(views, 3, 48), jnp.arange(5) != 3)
    assert largest_difference(distinct_columns(plain), distinct_columns(without)) > 1e-2


def test_wrong_calibration_degrades_as_the_hull_does():
    """Every camera turned by 0.3 degrees about an axis across its own: seven pixels of these crops."""
    views, angle = sphere_views(), np.deg2rad(0.3) / 2
    way = 2 * np.pi * np.arange(5) / 5 + 0.4
    turns = np.stack([np.full(5, np.cos(angle)), *(np.sin(angle) * f(way) for f in (np.cos, np.sin)), np.zeros(5)], -1)
    pose = views.camera.world_from_cam
    turned = pose.at[:, :3, :3].set(pose[:, :3, :3] @ rotation_from_quaternion(jnp.asarray(turns, jnp.float32)))
    wrong = replace(views, camera=replace(views.camera, world_from_cam=turned))
    wanted, many = hull_of(wrong)
    found, count = answer(SMALL.untrained(key=jax.random.key(0)), wrong, ALL)
    assert 50 < int(many) == int(count)
    np.testing.assert_allclose(found.columns(), wanted.columns(), rtol=2e-6, atol=2e-6)
    assert float(jnp.max(jnp.abs(wanted.mean[:50] - hull_of(views)[0].mean[:50]))) > 1e-3
    changed, same = answer(busy(), wrong, ALL)
    assert int(same) == int(many) and bool(jnp.all(jnp.isfinite(changed.columns())))


@pytest.mark.parametrize("mask", ["empty", "elsewhere", "everything"])
def test_a_wrong_mask_in_one_view_degrades_and_does_not_crash(mask):
    views, member = sphere_views(), busy()
    wrong = {"empty": jnp.zeros((96, 96)), "elsewhere": jnp.roll(views.mask[0], 40, axis=1), "everything": None}[mask]
    wrong = jnp.ones((96, 96)) if wrong is None else wrong
    found, count = answer(member, replace(views, mask=views.mask.at[0].set(wrong)), ALL)
    assert bool(jnp.all(jnp.isfinite(found.columns())))
    assert int(count) > 50


def test_an_empty_mask_counts_as_no_view():
    views, member = sphere_views(), busy()
    empty = replace(views, mask=views.mask.at[2].set(0.0))
    one, count = answer(member, empty, ALL)
    other, same = answer(member, views, jnp.arange(5) != 2)
    assert int(count) == int(same)
    assert largest_difference(distinct_columns(one), distinct_columns(other)) < 1e-5


def test_a_rod_that_half_fills_its_pixels_survives():
    """Its coverage is 0.4 wherever it is seen: binary masks have nothing of it."""
    cameras = rig(5)
    ends = jnp.array([[-0.4, -0.1, 0.0], [0.4, 0.15, 0.1]])
    views = views_of(cameras, lambda camera: rod_mask(camera, ends, 0.02))
    thin = replace(views, mask=0.4 * views.mask)
    assert int(answer(SMALL.untrained(key=jax.random.key(0)), thin, ALL)[1]) > 20
    assert int(jax.jit(lambda v: visual_hull(v, ALL, config=SMALL.hull)[1])(thin)) == 0


def test_nothing_at_all_is_finite():
    views, member = sphere_views(), busy()
    found, count = answer(member, replace(views, mask=jnp.zeros_like(views.mask)), ALL)
    assert int(count) == 0
    assert bool(jnp.all(jnp.isfinite(found.columns())))
    assert bool(jnp.all(jnp.isfinite(answer(member, views, jnp.zeros(5, bool))[0].columns())))


@pytest.mark.long
def test_vmap_is_a_loop():
    member, pair = busy(), [sphere_views(), sphere_views(radius=0.3)]
    stacked = jax.tree.map(lambda *x: jnp.stack(x), *pair)
    together, counts = jax.jit(jax.vmap(lambda views: member(views, ALL)))(stacked)
    for index, views in enumerate(pair):
        alone, count = answer(member, views, ALL)
        assert int(count) == int(counts[index])
        same = jax.tree.map(lambda x, i=index: x[i], together)
        assert largest_difference(distinct_columns(alone), distinct_columns(same)) < 1e-4


@pytest.mark.long
def test_every_parameter_learns():
    """With last layers that are not zero, the answer depends on every number of the network, and finitely."""

    def size(member, views):
        last = member.steps(views, ALL)[-1]
        return sum(jnp.sum(jnp.sin(3.0 * x)) for x in distinct_columns(last))

    gradient = jax.jit(jax.grad(size))(busy(), sphere_views())
    for leaf in jax.tree.leaves(gradient):
        assert bool(jnp.all(jnp.isfinite(leaf)))
        assert float(jnp.max(jnp.abs(leaf))) > 0


def test_a_change_is_bounded():
    member = busy(scale=40.0)  # saturates every head
    steps = all_steps(member, sphere_views())
    start, end = (parameters_of(step) for step in steps[:2])
    bounds, pixel = SMALL.bounds, float(1.4 * 19.5 / 20 / SMALL.image)
    real = np.asarray(steps[0].opacity) > 0
    moved = np.linalg.norm(np.asarray(end.mean - start.mean), axis=-1)[real]
    assert 0.5 * bounds.shift * pixel < moved.max() < 2 * 3**0.5 * bounds.shift * 1.1 * pixel
    grown = np.abs(np.asarray(end.log_scale - start.log_scale))[real]
    assert 0.5 * bounds.log_scale < grown.max() <= bounds.log_scale + 1e-5
    assert np.abs(np.asarray(end.logit - start.logit))[real].max() <= bounds.logit + 1e-4


def test_parameters_and_back():
    key = jax.random.key(0)
    opacity = jnp.array([0.02, 0.5, 0.95])
    some = Gaussians(
        jax.random.normal(key, (3, 3)), jnp.eye(3, 4), jnp.full((3, 3), 0.01), opacity, jnp.ones((3, 1, 3)) / 9
    )
    for got, wanted in zip(jax.tree.leaves(gaussians_of(parameters_of(some))), jax.tree.leaves(some), strict=True):
        np.testing.assert_allclose(got, wanted, rtol=1e-5)


@pytest.mark.parametrize(
    "changes",
    [{"image": 30}, {"updates": 0}, {"width": 0}, {"neighbours": 200}, {"channels": (4, 0, 4)}, {"coverage": 0.0}],
)
def test_sizes_that_do_not_work_are_refused(changes):
    with pytest.raises(UserError) as caught:
        replace(SMALL, **changes)
    assert caught.value.code == "out-of-range"


def test_the_default_has_few_parameters():
    member = jax.eval_shape(lambda key: RefineConfig().untrained(key=key), jax.random.key(0))
    assert 1e5 < sum(leaf.size for leaf in jax.tree.leaves(member)) < 1.5e6


def test_larger_crops_are_averaged():
    views = sphere_views()
    small = resized(views, 32)
    np.testing.assert_allclose(small.mask[0, 5, 9], views.mask[0, 15:18, 27:30].mean(), atol=1e-6)
    assert isinstance(small.camera, Camera)
    assert small.camera.width == small.camera.height == 32
    np.testing.assert_allclose(small.camera.K[:, :2] * 3.0, views.camera.K[:, :2], rtol=1e-6)
    assert resized(views, 96) is views
