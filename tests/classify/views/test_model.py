"""The views network: what leaves its answer as it was, what does not, and streams that equal clips."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.crop_examples import crops_of, random_crops, winged

from aerojax.classify.base import Classifier, Trainable, untrained
from aerojax.classify.views.config import MOST_VIEWS, ViewsConfig
from aerojax.classify.views.model import ViewsNetwork
from aerojax.core.errors import UserError
from aerojax.core.types import Evidence, Gaussians

SMALL = {"width": 16, "hidden": 16, "view_width": 16, "d_model": 16}
TIME, VIEWS = 6, 4
MASKS = {
    "all": np.ones((TIME, VIEWS), bool),
    "frames missing": np.repeat(np.array([0, 1, 1, 0, 0, 1], bool)[:, None], VIEWS, axis=1),
    "views come and go": np.random.default_rng(0).random((TIME, VIEWS)) < 0.5,
    "none": np.zeros((TIME, VIEWS), bool),
}


def classifier_of(**changes):
    return untrained(ViewsConfig(**SMALL, **changes), tokens=8, frames=TIME, key=jax.random.key(0))


def evidence(crops):
    return Evidence(Gaussians.from_columns(jnp.ones((*crops.valid.shape[:-1], 4, 14))), crops)


@jax.jit
def whole(classifier, crops, present=None):
    seen = evidence(crops)
    return classifier.clip(seen, jnp.ones(len(seen.crops.valid), bool) if present is None else present)


@jax.jit
def fold(classifier, crops, present):
    def step(state, frame):
        logits, state = classifier.step(*frame, state)
        return state, logits

    return jax.lax.scan(step, classifier.initial(), (evidence(crops), present))[1]


def test_it_is_a_classifier_that_reads_crops():
    classifier = classifier_of()
    assert isinstance(classifier, Classifier) and isinstance(classifier, Trainable)
    assert classifier.reads_crops and classifier.causal
    logits = whole(classifier, random_crops(0))
    assert logits.shape == (TIME, 4)
    np.testing.assert_allclose(jnp.exp(logits).sum(axis=1), 1.0, atol=1e-5)


@pytest.mark.parametrize("colour", [False, True])
@pytest.mark.parametrize("name", MASKS)
def test_the_fold_of_steps_is_the_clip(name, colour):
    classifier, crops = classifier_of(colour=colour), random_crops(1)
    crops = crops_of(crops.rgba, MASKS[name])
    present = jnp.asarray([True, True, False, True, True, True])
    np.testing.assert_allclose(fold(classifier, crops, present), whole(classifier, crops, present), atol=1e-5)


def test_no_frame_sees_a_later_one():
    classifier, crops, other = classifier_of(), random_crops(2), random_crops(3)
    later = crops_of(np.concatenate([crops.rgba[:4], other.rgba[4:]]), crops.valid)
    before, after = whole(classifier, crops), whole(classifier, later)
    np.testing.assert_allclose(before[:4], after[:4], atol=1e-6)
    assert jnp.abs(before[4:] - after[4:]).max() > 1e-4


def test_the_order_of_the_cameras_is_not_seen_but_that_of_the_frames_is():
    classifier, crops = classifier_of(), random_crops(4)
    crops = crops_of(crops.rgba, MASKS["views come and go"])
    order = np.array([2, 0, 3, 1])
    turned = crops_of(crops.rgba[:, order], crops.valid[:, order])
    np.testing.assert_allclose(whole(classifier, turned), whole(classifier, crops), atol=1e-5)
    backwards = crops_of(crops.rgba[::-1].copy(), crops.valid[::-1].copy())
    assert jnp.abs(whole(classifier, backwards)[-1] - whole(classifier, crops)[-1]).max() > 1e-4


def test_views_that_do_not_count_are_not_seen_whatever_they_hold():
    classifier, crops = classifier_of(colour=True), random_crops(5)
    valid = MASKS["views come and go"]
    garbage = np.where(valid[..., None, None, None], crops.rgba, 7.0).astype(np.float32)
    expected = whole(classifier, crops_of(crops.rgba, valid))
    np.testing.assert_array_equal(whole(classifier, crops_of(garbage, valid)), expected)
    padded = crops_of(np.pad(garbage, [(0, 0), (0, 3)] + [(0, 0)] * 3), np.pad(valid, [(0, 0), (0, 3)]))
    np.testing.assert_allclose(whole(classifier, padded), expected, atol=1e-5)
    # An empty crop says nothing, even where it is called valid.
    empty = crops_of(np.where(valid[..., None, None, None], crops.rgba, 0.0).astype(np.float32), np.ones_like(valid))
    np.testing.assert_allclose(whole(classifier, empty), expected, atol=1e-5)
    assert jnp.abs(whole(classifier, crops) - expected).max() > 1e-4


@pytest.mark.parametrize("colour", [False, True])
def test_colours_are_read_only_where_asked_for(colour):
    classifier, crops = classifier_of(colour=colour), random_crops(6)
    dark = crops_of(crops.rgba.at[..., :3].multiply(0.3), crops.valid)
    assert (jnp.abs(whole(classifier, dark) - whole(classifier, crops)).max() > 1e-5) == colour


def test_a_frame_without_a_view_leaves_the_state_alone():
    classifier, crops = classifier_of(), random_crops(7)
    step = jax.jit(lambda *inputs: classifier.step(*inputs))
    first, second = (jax.tree.map(lambda leaf, t=t: leaf[t], evidence(crops)) for t in (0, 1))
    before, state = step(first, jnp.ones((), bool), classifier.initial())
    none = Evidence(second.gaussians, crops_of(second.crops.rgba, jnp.zeros(VIEWS, bool)))
    for seen, valid in ((second, False), (none, True)):
        logits, after = step(seen, jnp.asarray(valid), state)
        np.testing.assert_array_equal(logits, before)
        assert jax.tree.all(jax.tree.map(lambda a, b: jnp.array_equal(a, b), state, after))


def test_a_roll_of_the_cameras_changes_less_than_other_wings():
    classifier = classifier_of()

    def clip(roll, wing):
        frames = [[winged(0.5 * np.sin(t), roll + v, wing=wing) for v in range(3)] for t in range(TIME)]
        rgba = np.repeat(np.array(frames, np.float32)[..., None], 4, axis=-1)
        return crops_of(rgba, np.ones((TIME, 3), bool))

    given = jnp.exp(whole(classifier, clip(0.0, 11.0)))
    rolled = max(float(jnp.abs(jnp.exp(whole(classifier, clip(r, 11.0))) - given).max()) for r in (0.3, 1.1, 2.6))
    other = float(jnp.abs(jnp.exp(whole(classifier, clip(0.0, 7.0))) - given).max())
    assert rolled < 0.5 * other


@jax.jit
def slopes_of(classifier, rgba, valid):
    def loss(classifier, rgba):
        mask, columns = jnp.ones((TIME, 4), bool), jnp.ones((TIME, 4, 14))
        return classifier.training_logits(columns, mask, crops_of(rgba, valid), key=jax.random.key(1))[0, 0]

    return jax.grad(loss, argnums=(0, 1))(classifier, rgba)


@pytest.mark.parametrize("name", MASKS)
def test_gradients_are_finite_whatever_counts(name):
    classifier, crops = classifier_of(colour=True), random_crops(8)
    rgba, valid = jnp.asarray(crops.rgba).at[2].set(0.0), jnp.asarray(MASKS[name])

    slopes = slopes_of(classifier, rgba, valid)
    assert all(bool(jnp.isfinite(leaf).all()) for leaf in jax.tree.leaves(slopes))
    assert jnp.abs(slopes[0].network.head.out.bias[...]).max() > 0


def test_without_crops_or_with_too_many_cameras_it_says_so():
    classifier, present = classifier_of(), jnp.ones((), bool)
    gaussians = Gaussians.from_columns(jnp.ones((4, 14)))
    with pytest.raises(UserError, match="given no crops") as error:
        classifier.step(Evidence(gaussians), present, classifier.initial())
    assert error.value.code == "missing"
    many = crops_of(jnp.zeros((MOST_VIEWS + 1, 32, 32, 4)), jnp.ones(MOST_VIEWS + 1, bool))
    with pytest.raises(UserError, match="17 cameras"):
        classifier.step(Evidence(gaussians, many), present, classifier.initial())


def test_the_default_network_is_small():
    network = jax.eval_shape(lambda: ViewsNetwork(ViewsConfig(), key=jax.random.key(0)))
    assert sum(leaf.size for leaf in jax.tree.leaves(network)) < 500_000


@pytest.mark.parametrize("field", [{"width": 0}, {"reach": 0.0}, {"harmonics": 16}, {"dropout": 1.0}])
def test_what_cannot_be_built_is_refused(field):
    with pytest.raises(UserError, match=next(iter(field))):
        ViewsConfig(**field)
