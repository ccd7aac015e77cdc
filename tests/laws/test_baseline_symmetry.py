"""VN-PointNet and VN-DGCNN answer alike however a clip is turned; P4Transformer and Mamba4D do not."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from flax import nnx
from support.clip_examples import random_clip, rotate_columns
from support.tiny_baselines import CLIP_WISE, FRAME_WISE, TIME, TOKENS, tiny_classifier

from aerojax.geometry.rotations import haar_rotation, rotation_about_z

MASK = jnp.ones((TIME, TOKENS), bool)


class Biased(nnx.Module):
    """A linear map of vectors plus a fixed one."""

    def __init__(self, linear):
        self.linear = linear

    def __call__(self, x):
        return self.linear(x) + 0.1


@jax.jit
def read(classifier, clips):
    return jax.vmap(lambda clip: classifier.logits(clip, MASK))(clips)


def turned(clips, rotation):
    return jax.vmap(rotate_columns, in_axes=(0, None))(clips, rotation)


def example(name, kind):
    classifier = jax.tree.map(lambda leaf: leaf.astype(kind), tiny_classifier(name))
    return classifier, jnp.stack([random_clip(seed, time=TIME, tokens=TOKENS, dtype=kind) for seed in (0, 1)])


@pytest.mark.parametrize("name", FRAME_WISE)
def test_no_rotation_changes_the_answer_of_vector_networks(x64, name):
    classifier, clips = example(name, jnp.float64)
    assert classifier.card.rotation_invariant
    logits = read(classifier, clips)
    assert np.abs(logits[0] - logits[1]).max() > 1e-3  # they read the clips
    drift = [np.abs(read(classifier, turned(clips, haar_rotation(key=key))) - logits).max() for key in keys(6)]
    assert max(drift) <= 1e-10
    # The check can fail: a bias stands still while vectors turn.
    biased = jax.tree.map(lambda leaf: leaf, classifier)
    biased.network.first.feature = Biased(classifier.network.first.feature)
    still = np.abs(read(biased, turned(clips, haar_rotation(key=keys(1)[0]))) - read(biased, clips)).max()
    assert still > 1e-6


@pytest.mark.parametrize("name", FRAME_WISE)
def test_only_vn_pointnet_knows_handedness(x64, name):
    classifier, clips = example(name, jnp.float64)
    mirrored = clips.at[..., 0].multiply(-1.0)
    difference = np.abs(read(classifier, mirrored) - read(classifier, clips)).max()
    assert difference > 1e-6 if name == "vn_pointnet" else difference <= 1e-10


@pytest.mark.long
@pytest.mark.parametrize("name", CLIP_WISE)
def test_rotations_change_the_answer_of_the_others(name):
    """Measured over 4 rotations: largest change of a logit over the spread of logits between clips."""
    classifier, clips = example(name, jnp.float32)
    assert not classifier.card.rotation_invariant
    logits = read(classifier, clips)
    spread = np.abs(logits[0] - logits[1]).max()
    about_z = [rotation_about_z(jnp.asarray(angle)) for angle in (1.0, 2.0)]
    for rotation in (*about_z, *(haar_rotation(key=key) for key in keys(2))):
        assert np.abs(read(classifier, turned(clips, rotation)) - logits).max() > 0.05 * spread


def keys(count):
    return jax.random.split(jax.random.key(3), count)
