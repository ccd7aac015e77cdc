"""A stream is a clip: the fold of `step` gives the logits of `clip` after every frame, no frame sees a later one."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.clip_examples import random_clip, rotate_columns

from aerojax.classify.base import Classifier, untrained
from aerojax.classify.mambasplat.config import MambaSplatConfig, published_config
from aerojax.core.errors import UserError
from aerojax.core.types import Evidence, Gaussians
from aerojax.geometry.rotations import haar_rotation

SMALL = {"depth": 1, "mamba_layers": 2, "d_model": 16, "channels": 4, "token_features": 8, "token_invariants": 8}
CAUSAL = {
    "frame": {"scale_normalisation": "frame"},
    "none": {"scale_normalisation": "none", "readout": "last"},
    "running": {"scale_normalisation": "running"},
    "running, last, metric": {"scale_normalisation": "running", "readout": "last", "metric_size": True},
    "running, merged": {"scale_normalisation": "running", "merged_tokens": 5},
    "running, features": {
        "scale_normalisation": "running",
        "motion_features": True,
        "shape_features": True,
        "flight_features": True,
        "spectrum_features": True,
    },
    "running, without time": {"scale_normalisation": "running", "temporal": "none"},
}
AHEAD = {
    "scale_normalisation": {"scale_normalisation": "clip"},
    "positional_encoding": {"scale_normalisation": "running", "positional_encoding": True},
}
TIME = 9
MASKS = {
    "all frames": np.ones(TIME, bool),
    "some missing": np.array([1, 1, 0, 0, 1, 0, 1, 1, 0], bool),
    "late": np.array([0, 0, 1, 0, 1, 1, 1, 1, 1], bool),
    "no frame": np.zeros(TIME, bool),
}


def classifier_of(changes, **card):
    return untrained(MambaSplatConfig(**SMALL, **changes), tokens=8, frames=TIME, key=jax.random.key(0), **card)


def growing_clip(seed):
    """Gaussians of an object that grows, so that frames have radii of their own."""
    clip = random_clip(seed, time=TIME, tokens=20)
    size = jnp.exp(0.2 * jnp.arange(TIME, dtype=clip.dtype))[:, None, None]
    return Gaussians.from_columns(clip.at[..., :3].multiply(size).at[..., 7:10].multiply(size))


@jax.jit
def whole(classifier: Classifier, clip: Gaussians, valid):
    return classifier.clip(Evidence(clip), valid)


@jax.jit
def fold(classifier: Classifier, clip: Gaussians, valid):
    def step(state, frame):
        logits, state = classifier.step(*frame, state)
        return state, logits

    return jax.lax.scan(step, classifier.initial(), (Evidence(clip), valid))[1]


@pytest.mark.parametrize("name", CAUSAL)
def test_the_fold_of_steps_is_the_clip(name):
    classifier = classifier_of(CAUSAL[name], token_ensembles=3)  # of which two have tokens
    assert classifier.causal
    for seed, valid in enumerate(MASKS.values()):
        clip = growing_clip(seed)
        np.testing.assert_allclose(
            fold(classifier, clip, jnp.asarray(valid)), whole(classifier, clip, jnp.asarray(valid)), atol=1e-5
        )


@pytest.mark.parametrize("name", ["running", "frame", "running, features"])
def test_no_frame_sees_a_later_one(name):
    classifier, clip, valid = classifier_of(CAUSAL[name]), growing_clip(0), jnp.ones(TIME, bool)
    later = jax.tree.map(lambda leaf: leaf.at[6:].multiply(3.0), clip)
    before, after = whole(classifier, clip, valid), whole(classifier, later, valid)
    np.testing.assert_array_equal(before[:6], after[:6])
    assert jnp.abs(before[6:] - after[6:]).max() > 1e-4
    # The check can fail: a clip's own radius is seen from its first frame on.
    looking = classifier_of(AHEAD["scale_normalisation"])
    assert jnp.abs(whole(looking, clip, valid)[0] - whole(looking, later, valid)[0]).max() > 1e-4


def test_running_is_not_frame():
    clip, valid = growing_clip(1), jnp.ones(TIME, bool)
    running, frame = (whole(classifier_of(CAUSAL[name]), clip, valid) for name in ("running", "frame"))
    np.testing.assert_allclose(running[0], frame[0], atol=1e-6)
    assert jnp.abs(running[-1] - frame[-1]).max() > 1e-4


@pytest.mark.parametrize("field", AHEAD)
def test_models_that_look_ahead_say_which_field_does(field):
    classifier, clip = classifier_of(AHEAD[field]), growing_clip(0)
    assert not classifier.causal
    with pytest.raises(UserError, match=f"{field} is .* in MambaSplatConfig") as error:
        classifier.step(Evidence(jax.tree.map(lambda leaf: leaf[0], clip)), jnp.ones((), bool), classifier.initial())
    assert error.value.code == "mismatch"
    assert not untrained(published_config(**SMALL_PUBLISHED), tokens=8, frames=4, key=jax.random.key(0)).causal


SMALL_PUBLISHED = {name: value for name, value in SMALL.items() if not name.startswith("token_")}


def test_a_running_stream_does_not_see_rotations():
    classifier, clip, valid = classifier_of(CAUSAL["running"]), growing_clip(2), jnp.asarray(MASKS["some missing"])
    logits = whole(classifier, clip, valid)
    for key in jax.random.split(jax.random.key(4), 8):
        turned = Gaussians.from_columns(rotate_columns(clip.columns(), haar_rotation(key=key)))
        np.testing.assert_allclose(whole(classifier, turned, valid), logits, atol=1e-5)
    stretched = Gaussians.from_columns(clip.columns().at[..., 0].multiply(2.0))
    assert jnp.abs(whole(classifier, stretched, valid) - logits).max() > 1e-3


def test_a_frame_that_is_not_valid_leaves_the_state_alone():
    classifier, clip = classifier_of(CAUSAL["running"]), growing_clip(3)
    first, second = (Evidence(jax.tree.map(lambda leaf, t=t: leaf[t], clip)) for t in (0, 1))
    step = jax.jit(lambda *inputs: classifier.step(*inputs))
    before, state = step(first, jnp.ones((), bool), classifier.initial())
    logits, after = step(second, jnp.zeros((), bool), state)
    np.testing.assert_array_equal(logits, before)
    assert jax.tree.all(jax.tree.map(lambda a, b: jnp.array_equal(a, b), state, after))


def test_memory_of_a_clip_grows_with_its_length_and_not_with_the_square():
    classifier = classifier_of(CAUSAL["running"])

    def working_bytes(frames):
        clip = Gaussians.from_columns(jnp.zeros((frames, 8, 14)))
        return whole.lower(classifier, clip, jnp.ones(frames, bool)).compile().memory_analysis().temp_size_in_bytes

    assert working_bytes(512) < 5 * working_bytes(128)
