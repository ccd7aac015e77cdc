"""Training of reconstructors: the loss, which views are drawn, weights of steps, resuming with equal bits."""

from __future__ import annotations

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.view_sets import ball, ball_scenes

from aerojax.core.types import Gaussians, pytree_dataclass
from aerojax.reconstruct.base import TrainableReconstructor
from aerojax.reconstruct.lgm.config import LgmConfig
from aerojax.training.loop import TrainingConfig
from aerojax.training.optimisers import OptimiserConfig
from aerojax.training.tasks.reconstruction import (
    LossConfig,
    ReconstructionTask,
    SceneConfig,
    drawn,
    drawn_over,
    rendering_loss,
    scene_arrays,
    train_reconstructor,
    unpacked,
)

SCENES = ball_scenes(6)
WHITE = jnp.ones((3, 3))
TINY = LgmConfig(size=16, down=(16, 16), up=(16,), attends_down=(False, True), attends_up=(False,))
TRAINING = TrainingConfig(epochs=2, batch=2, checkpoint_steps=0, optimiser=OptimiserConfig(learning_rate=1e-3))


def scene(index=0):
    return unpacked(jax.tree.map(lambda x: jnp.asarray(x[0]), scene_arrays(SCENES, np.array([index]))))


def loss_of(gaussians: Gaussians, **weights: float) -> float:
    targets = scene()[2]
    only = replace(LossConfig(colour=0.0, perceptual=0.0, mask=0.0, depth=0.0), **weights)
    return float(rendering_loss(drawn_over(gaussians, targets, WHITE), targets, WHITE, only, None))


@pytest.mark.parametrize("term", ["colour", "foreground", "dssim", "mask", "depth"])
def test_a_term_is_least_for_the_truth(term):
    truth = ball(jax.random.key(0))
    changed = {
        "paler": replace(truth, sh=0.2 * truth.sh),
        "fainter": replace(truth, opacity=0.3 * truth.opacity),
        "nearer": replace(truth, mean=truth.mean * 0.6),
    }
    right = loss_of(truth, **{term: 1.0})
    assert right < {"colour": 1e-4, "foreground": 1e-4, "dssim": 0.01, "mask": 1e-4, "depth": 0.02}[term]
    concerned = {"colour": "paler", "foreground": "paler", "dssim": "paler", "mask": "fainter", "depth": "nearer"}[term]
    assert loss_of(changed[concerned], **{term: 1.0}) > 4 * right


def test_depth_off_the_object_is_right_where_nothing_is_drawn():
    nothing = replace(ball(jax.random.key(0)), opacity=jnp.zeros(60))
    on_the_object = loss_of(nothing, depth=1.0, background=0.0)
    # Pixels that the object covers by less than half mix both depths.
    assert loss_of(nothing, depth=1.0, background=1.0) < on_the_object + 0.1
    everywhere = replace(ball(jax.random.key(0), radius=0.7), scale=jnp.full((60, 3), 0.3))
    assert loss_of(everywhere, depth=1.0, background=1.0) > loss_of(everywhere, depth=1.0, background=0.0) + 0.1


def test_drawn_views_are_some_of_those_that_count():
    views, valid, targets = scene()
    counts = set()
    for number in range(20):
        got, used, seen = drawn((views, valid, targets), SceneConfig((2, 3), 2), key=jax.random.key(number))
        assert got.mask.shape[0] == 3 and seen.mask.shape[0] == 2
        counts.add(int(used.sum()))
        for view in np.flatnonzero(used):
            same = [
                i for i in range(4) if np.array_equal(got.camera.world_from_cam[view], views.camera.world_from_cam[i])
            ]
            assert len(same) == 1
            np.testing.assert_array_equal(got.rgb[view], views.rgb[same[0]])
    assert counts == {2, 3}


@pytree_dataclass
class Steps:
    """A member whose three answers are balls of its own opacities."""

    opacity: jax.Array

    @property
    def network(self):
        return self.opacity

    def steps(self, views, valid):
        truth = ball(jax.random.key(0))
        return tuple(replace(truth, opacity=jnp.broadcast_to(o, (60,))) for o in self.opacity)

    def __call__(self, views, valid):
        return self.steps(views, valid)[-1], jnp.asarray(60)


def test_later_steps_weigh_more_and_the_start_nothing():
    task = ReconstructionTask(
        SCENES, SCENES, SceneConfig((3, 4), 3), LossConfig(colour=0.0, depth=0.0, mask=1.0), TRAINING, 0
    )
    batch, keys = scene_arrays(SCENES, np.array([0])), jax.random.split(jax.random.key(0), 1)
    member = Steps(jnp.array([0.5, 0.5, 0.5]))
    assert isinstance(member, TrainableReconstructor)
    slope = jax.grad(task.loss)(member, batch, keys).opacity
    assert float(slope[0]) == 0.0
    np.testing.assert_allclose(slope[1] / slope[2], 0.9, rtol=1e-5)


def trained(directory, *, dies_after=None):
    weights = LossConfig(behind="random")
    task = ReconstructionTask(SCENES, ball_scenes(1), SceneConfig((3, 4), 1), weights, TRAINING, 3)
    rows = []

    def report(row):
        rows.append(row)
        if row["epoch"] == dies_after:
            raise InterruptedError

    return train_reconstructor(TINY, task, directory=directory, report=report, watch=lambda step, figures: None), rows


@pytest.mark.long
def test_a_killed_training_goes_on_with_equal_bits(tmp_path):
    whole, rows = trained(tmp_path / "whole")
    with pytest.raises(InterruptedError):
        trained(tmp_path / "killed", dies_after=1)
    again, rest = trained(tmp_path / "killed")
    assert rest == rows[1:] and len(rows) == 2
    for a, b in zip(jax.tree.leaves(whole), jax.tree.leaves(again), strict=True):
        np.testing.assert_array_equal(a, b)
