"""The member behind its door: three views, masks that are empty or wrong, views that do not count, training."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.depthsplat_examples import SMALL, all_of, disc_views, predict, small_depthsplat

from aerojax.core.errors import UserError
from aerojax.core.tensors import parameter_names
from aerojax.core.types import Gaussians, View
from aerojax.reconstruct.base import TrainableReconstructor
from aerojax.reconstruct.depthsplat.network import resized_views
from aerojax.reconstruct.depthsplat.reconstructor import LEAST_OPACITY, strongest

VIEWS, SIZE = 3, SMALL.size
EVERY = jnp.ones(VIEWS, bool)


def views(**changes: jax.Array) -> View:
    return dataclasses.replace(disc_views(VIEWS, SIZE), **changes)


def by_view(gaussians: Gaussians) -> Gaussians:
    return jax.tree.map(lambda leaf: np.asarray(leaf).reshape(VIEWS, SIZE, SIZE, *leaf.shape[1:]), gaussians)


def test_three_views():
    member = small_depthsplat()
    assert isinstance(member, TrainableReconstructor)
    found = predict(member, views(), EVERY)
    masks = np.asarray(views().mask) > 0.5
    gaussians = by_view(found.gaussians)
    assert np.all(gaussians.opacity[~masks] == 0) and np.all(gaussians.opacity[masks] > 0)
    depth = np.asarray(found.depth)
    # Every pixel of a view without an object is at one depth, the far end; the object is before it.
    assert np.ptp(depth[0][~masks[0]]) < 1e-5 and depth[0][masks[0]].min() < depth[0][~masks[0]].max() - 0.05
    distance = np.linalg.norm(np.asarray(views().camera.world_from_cam[:, :3, 3]), axis=-1)
    assert np.all(np.abs(depth[masks] - distance.mean()) < 1.3)


def test_the_call_keeps_what_can_be_seen():
    member = small_depthsplat()
    everything = predict(member, views(), EVERY).gaussians
    shown = np.flatnonzero(np.asarray(everything.opacity) > LEAST_OPACITY)
    _, (kept, count), _ = all_of(member, views(), EVERY)
    assert int(count) == len(shown) < len(kept.opacity)
    np.testing.assert_allclose(kept.mean[: len(shown)], everything.mean[shown], atol=1e-6)
    np.testing.assert_array_equal(
        kept.mean[len(shown) :], jnp.broadcast_to(kept.mean[:1], kept.mean[len(shown) :].shape)
    )


def test_thinning_and_filling():
    rng = np.random.default_rng(0)
    columns = jnp.asarray(rng.uniform(0.1, 1, (10, 14)), jnp.float32)
    gaussians = Gaussians.from_columns(columns.at[jnp.asarray([1, 4]), 10].set(0.0))
    few, count = strongest(gaussians, 4)
    assert int(count) == 4 and len(few.opacity) == 4
    np.testing.assert_array_equal(few.mean, gaussians.mean[jnp.asarray([0, 3, 6, 8])])
    everything, count = strongest(gaussians, 99)
    assert int(count) == 8 and len(everything.opacity) == 10
    np.testing.assert_array_equal(everything.mean[8:], jnp.broadcast_to(gaussians.mean[:1], (2, 3)))
    none, count = strongest(dataclasses.replace(gaussians, opacity=jnp.zeros(10)), 4)
    assert int(count) == 0 and np.isfinite(none.columns()).all()


@pytest.mark.parametrize("mask", [0.0, 1.0], ids=["empty", "everything"])
def test_a_wrong_mask_degrades_and_does_not_crash(mask):
    """The other views keep their pixels; only what the wrong view itself says is wrong."""
    member = small_depthsplat()
    wrong = views(mask=disc_views(VIEWS, SIZE).mask.at[1].set(mask))
    found = predict(member, wrong, EVERY)
    gaussians = by_view(found.gaussians)
    assert np.isfinite(found.gaussians.columns()).all() and np.isfinite(found.depth).all()
    masks = np.asarray(wrong.mask) > 0.5
    assert np.all((gaussians.opacity > 0) == masks)


def test_a_view_that_does_not_count_is_not_read():
    member, valid = small_depthsplat(), jnp.asarray([True, False, True])
    rgb = disc_views(VIEWS, SIZE).rgb
    one, other = (by_view(predict(member, views(rgb=x), valid).gaussians) for x in (rgb, rgb.at[1].set(0.25)))
    for view in (0, 2):
        np.testing.assert_array_equal(one.columns()[view], other.columns()[view])
    assert np.all(one.opacity[1] == 0)
    read = by_view(predict(member, views(rgb=rgb.at[1].set(0.25)), EVERY).gaussians)
    assert not np.allclose(read.mean[0], by_view(predict(member, views(), EVERY).gaussians).mean[0], atol=1e-5)


def test_no_view_counts_and_no_mask_shows_anything():
    member = small_depthsplat()
    for shown, valid in ((views(), ~EVERY), (views(mask=jnp.zeros((VIEWS, SIZE, SIZE))), EVERY)):
        found = predict(member, shown, valid)
        assert float(jnp.max(found.gaussians.opacity)) == 0.0 and np.isfinite(found.gaussians.columns()).all()


@pytest.mark.long
def test_every_parameter_learns():
    """But those in front of an instance norm, which takes their effect away."""

    @jax.jit
    def slope(member, views):
        def loss(member):
            (gaussians,) = member.steps(views, EVERY)
            return jnp.sum(jnp.sin(3 * gaussians.columns())) + jnp.sum(member.predict(views, EVERY).depth ** 2)

        return jax.grad(loss)(member)

    found = dict(parameter_names(slope(small_depthsplat(), views()).network))
    assert all(np.isfinite(leaf).all() for leaf in found.values())
    still = {name for name, leaf in found.items() if float(jnp.max(jnp.abs(leaf))) < 1e-6}
    assert all("shortcut.bias" in name for name in still), still


def test_weights_of_half_precision_place_gaussians_in_single_precision():
    halves = jax.tree.map(lambda leaf: jax.ShapeDtypeStruct(leaf.shape, jnp.bfloat16), small_depthsplat())
    found = jax.eval_shape(lambda member: member.predict(views(), EVERY), halves)
    assert {leaf.dtype for leaf in jax.tree.leaves(found)} == {jnp.dtype("float32")}


def test_many_frames_at_once():
    frames = jax.tree.map(lambda leaf: jnp.stack([leaf, leaf]), views())
    kept, count = jax.eval_shape(jax.vmap(lambda one: small_depthsplat()(one, EVERY)), frames)
    assert kept.mean.shape == (2, VIEWS * SIZE * SIZE, 3) and count.shape == (2,)


def test_filling_is_transparent_in_training():
    _, (kept, count), rendered = all_of(small_depthsplat(), views(), EVERY)
    assert 0 < int(count) < len(kept.opacity) and np.all(np.asarray(kept.opacity[count:]) > 0)
    assert np.all(np.asarray(rendered.opacity[count:]) == 0)
    np.testing.assert_array_equal(rendered.opacity[:count], kept.opacity[:count])


def test_views_of_another_size():
    shrunk = resized_views(disc_views(VIEWS, 2 * SIZE), SIZE)
    assert shrunk.rgb.shape == (VIEWS, SIZE, SIZE, 3) and shrunk.camera.width == SIZE
    np.testing.assert_allclose(shrunk.camera.K, disc_views(VIEWS, SIZE).camera.K, rtol=1e-6)
    np.testing.assert_allclose(shrunk.mask[0].sum() * 4, disc_views(VIEWS, 2 * SIZE).mask[0].sum(), rtol=0.02)
    same = disc_views(VIEWS, SIZE)
    assert resized_views(same, SIZE) is same


@pytest.mark.parametrize(("count", "size", "named"), [(1, SIZE, "single view"), (2, 2 * SIZE, "64×64")])
def test_refusals(count, size, named):
    with pytest.raises(UserError, match=named) as caught:
        small_depthsplat().network(disc_views(count, size), jnp.ones(count, bool))
    assert caught.value.code == "mismatch"
