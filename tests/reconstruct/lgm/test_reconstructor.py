"""LGM: the published number of parameters, the door's promises, views that do not count, gradients."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.hull_views import rig, sphere_mask, views_of

from aerojax.core.errors import UserError
from aerojax.core.tensors import parameter_count
from aerojax.reconstruct.base import TrainableReconstructor
from aerojax.reconstruct.lgm.config import LgmConfig, published_config
from aerojax.reconstruct.weights import save_reconstructor, weights_header

SMALL = LgmConfig(size=16, down=(16, 16, 32), up=(32, 16), attends_down=(False, False, True), attends_up=(False, False))


def ball_views(count):
    return views_of(rig(count), lambda camera: sphere_mask(camera, 0.4))


MEMBER = SMALL.untrained(key=jax.random.key(0))


def test_the_published_model_has_its_parameters():
    shapes = jax.eval_shape(lambda key: published_config().untrained(key=key), jax.random.key(0))
    assert parameter_count(shapes.network) == 415_042_848


@pytest.mark.long
def test_a_view_becomes_gaussians_within_the_cube():
    views = ball_views(4)
    valid = jnp.array([True, True, False, True])
    found, count = jax.jit(lambda v, ok: MEMBER(v, ok))(views, valid)
    assert isinstance(MEMBER, TrainableReconstructor) and found.mean.shape == (4 * 8 * 8, 3)
    assert 0 < int(count) <= 3 * 64
    assert np.isfinite(np.asarray(found.columns())).all()
    np.testing.assert_allclose(np.linalg.norm(found.quaternion, axis=-1), 1.0, atol=1e-5)
    np.testing.assert_array_equal(found.mean[int(count) :], np.broadcast_to(found.mean[0], (256 - int(count), 3)))
    (step,) = MEMBER.steps(views, valid)
    assert not np.asarray(step.opacity)[2 * 64 : 3 * 64].any()


def test_a_view_that_does_not_count_changes_nothing():
    views, valid = ball_views(4), jnp.array([True, True, True, False])
    other = dataclasses.replace(views, rgb=views.rgb.at[3].set(0.5), mask=views.mask.at[3].set(1.0))
    a, b = (MEMBER.steps(v, valid)[0].columns() for v in (views, other))
    np.testing.assert_array_equal(a, b)


@pytest.mark.long
def test_the_answer_scales_with_the_scene():
    views, valid = ball_views(3), jnp.ones(3, bool)
    pose = views.camera.world_from_cam
    far = dataclasses.replace(views.camera, world_from_cam=pose.at[:, :3, 3].multiply(7.0))
    (near_step,), (far_step,) = MEMBER.steps(views, valid), MEMBER.steps(dataclasses.replace(views, camera=far), valid)
    np.testing.assert_allclose(far_step.mean, 7.0 * near_step.mean, rtol=1e-3, atol=1e-4)
    np.testing.assert_allclose(far_step.scale, 7.0 * near_step.scale, rtol=1e-3)


@pytest.mark.long
@pytest.mark.parametrize("precision", ["float32", "bfloat16"])
def test_gradients_are_finite_without_any_view(precision):
    member = dataclasses.replace(SMALL, precision=precision).untrained(key=jax.random.key(1))
    views = ball_views(3)
    for valid in (jnp.ones(3, bool), jnp.zeros(3, bool)):
        gradient = jax.grad(lambda m, ok=valid: jnp.sum(m.steps(views, ok)[0].mean ** 2))(member)
        assert all(np.isfinite(np.asarray(leaf)).all() for leaf in jax.tree.leaves(gradient))


def test_weights_come_back_with_their_configuration(tmp_path):
    path = tmp_path / "weights.safetensors"
    save_reconstructor(path, MEMBER, SMALL, {"seed": 3})
    config = dataclasses.replace(SMALL, weights=str(path))
    again = config.build()
    for a, b in zip(jax.tree.leaves(MEMBER), jax.tree.leaves(again), strict=True):
        np.testing.assert_array_equal(a, b)
    assert weights_header(path)[1] == {"seed": 3} and config.build() is again
    assert dataclasses.replace(config, precision="bfloat16").build().config.precision == "bfloat16"
    with pytest.raises(UserError, match="trained with another heads") as error:
        dataclasses.replace(config, heads=2).build()
    assert error.value.code == "mismatch"


def test_levels_that_do_not_fit_are_refused():
    with pytest.raises(UserError, match="4 levels down, 2 up"):
        LgmConfig(up=(64, 32))
    with pytest.raises(UserError, match="does not halve"):
        LgmConfig(size=20)
