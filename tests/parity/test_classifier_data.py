"""Loss, votes, farthest points and preprocessing against stored results of the released code."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from aerojax.classify.released.normalisation import normalise_published
from aerojax.evaluate.answers import video_vote
from aerojax.geometry.rotations import canonical_sign, normalise
from aerojax.training.loop import smoothed_cross_entropy
from kernels.sampling.farthest_points import farthest_points
from kernels.sampling.farthest_points_reference import farthest_points as farthest_points_reference

NEAR_ORIGIN = 1e-3
"""Squared norm up to which the released sampler skips a point."""


@pytest.mark.parametrize("smoothing", [0.0, 0.1, 0.2])
def test_smoothed_loss(shared, x64, smoothing):
    golden = np.load(shared / "golden/classifier/loss.npz")
    logits, labels = jnp.asarray(golden["logits"]), jnp.asarray(golden["labels"])
    losses = smoothed_cross_entropy(logits, labels, smoothing)
    np.testing.assert_allclose(losses, golden[f"per_sample_eps{smoothing}"], atol=1e-12)
    if smoothing == 0.1:
        gradient = jax.grad(lambda logits: smoothed_cross_entropy(logits, labels, smoothing).mean())(logits)
        np.testing.assert_allclose(gradient, golden["grad_eps0.1"], atol=1e-12)


def test_video_vote(shared):
    golden = np.load(shared / "golden/classifier/video_vote.npz")
    probabilities = video_vote(jnp.asarray(golden["clip_logits"]), jnp.asarray(golden["video_idx"]), 5)
    np.testing.assert_allclose(probabilities, golden["video_probs"], atol=1e-6)
    np.testing.assert_array_equal(jnp.argmax(probabilities, axis=1), golden["video_pred"])


@pytest.mark.parametrize("sampler", [farthest_points, farthest_points_reference], ids=["kernel", "reference"])
@pytest.mark.parametrize(("cloud", "indices"), [("0", "0"), ("1", "1"), ("2", "2"), ("2", "2_over"), ("3", "3")])
def test_farthest_points(shared, sampler, cloud, indices):
    golden = np.load(shared / "golden/classifier/fps.npz")
    points, expected = jnp.asarray(golden[f"cloud{cloud}"]), golden[f"idx{indices}"]
    np.testing.assert_array_equal(sampler(points, len(expected), min_square_norm=NEAR_ORIGIN), expected)


@pytest.mark.parametrize("sampler", [farthest_points, farthest_points_reference], ids=["kernel", "reference"])
def test_choosing_all_points_is_a_permutation(shared, sampler):
    golden = np.load(shared / "golden/classifier/fps.npz")
    # The released code returns the identity without sampling where all points are wanted; ours keeps the greedy order.
    np.testing.assert_array_equal(np.sort(sampler(jnp.asarray(golden["cloud0"]), 50)), golden["idx0_all"])


def test_farthest_points_of_a_batch():
    clouds = jnp.asarray(np.random.default_rng(0).normal(size=(3, 60, 3)).astype(np.float32))
    one_by_one = jnp.stack([farthest_points_reference(cloud, 20, start=4) for cloud in clouds])
    np.testing.assert_array_equal(jax.vmap(lambda cloud: farthest_points(cloud, 20, start=4))(clouds), one_by_one)


def test_published_decimation_picks_the_stored_points(shared):
    golden = np.load(shared / "golden/classifier/decimation.npz")
    drawn, far, choice = (golden[f"seed7/{name}"] for name in ("pre_idx", "fps_idx", "choice"))
    position = jnp.asarray(golden["norm/position"][drawn])
    np.testing.assert_array_equal(farthest_points(position, len(far), min_square_norm=NEAR_ORIGIN), far)
    columns = np.concatenate([golden[f"norm/{n}"] for n in ("position", "quaternion", "scale", "opacity", "sh_dc")], 1)
    np.testing.assert_allclose(columns[drawn[far[choice]]], golden["version_seed7_400_120_64"], atol=1e-7)


def test_published_normalisation(shared):
    golden = np.load(shared / "golden/classifier/decimation.npz")
    quaternion = np.stack([golden[f"raw/rot_{i}"] for i in range(4)], axis=1)
    turned = canonical_sign(normalise(jnp.asarray(quaternion)))
    np.testing.assert_allclose(turned, golden["act/quaternion"], atol=1e-6)
    names = ("position", "quaternion", "scale", "opacity", "sh_dc")
    active = np.concatenate([golden[f"act/{n}"].reshape(1500, -1) for n in names], axis=1)
    expected = np.concatenate([golden[f"norm/{n}"].reshape(1500, -1) for n in names], axis=1)
    np.testing.assert_allclose(normalise_published(jnp.asarray(active)), expected, atol=2e-6)
