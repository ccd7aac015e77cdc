"""The 2D baselines on crops: streams that equal clips, what they do not see, and what they learn from."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.clip_examples import random_clip
from support.crop_examples import crops_of, random_crops

from aerojax.classify.base import CLIP_AXIS, Classifier, Trainable, untrained
from aerojax.classify.images.classifier import windows_of
from aerojax.classify.images.config import B3LiteConfig, B4LiteConfig
from aerojax.classify.images.votes import cast
from aerojax.classify.load import load_classifier, save_classifier
from aerojax.classify.views.config import MOST_VIEWS
from aerojax.core.errors import UserError
from aerojax.core.types import Evidence, Gaussians

TIME, VIEWS = 6, 3
KINDS = {"b4_lite": B4LiteConfig, "b3_lite": B3LiteConfig}
PRESENT = np.array([True, False, True, True, True, False])
COME_AND_GO = np.random.default_rng(0).random((TIME, VIEWS)) < 0.6


def classifier_of(name, **changes):
    config = KINDS[name](**{"width": 8, "pixels": 16, "sample": 7} | changes)
    return untrained(config, tokens=8, frames=TIME, key=jax.random.key(0))


def evidence(crops):
    return Evidence(Gaussians.from_columns(jnp.ones((*crops.valid.shape[:-1], 4, 14))), crops)


@jax.jit
def whole(classifier, crops, present):
    return classifier.clip(evidence(crops), present)


@jax.jit
def fold(classifier, crops, present):
    def step(state, frame):
        logits, state = classifier.step(*frame, state)
        return state, logits

    return jax.lax.scan(step, classifier.initial(), (evidence(crops), present))[1]


def some_crops(seed):
    return crops_of(random_crops(seed, time=TIME, views=VIEWS).rgba, COME_AND_GO)


@pytest.mark.parametrize("name", KINDS)
def test_the_fold_of_steps_is_the_clip(name):
    classifier, crops = classifier_of(name), some_crops(1)
    assert isinstance(classifier, Classifier) and isinstance(classifier, Trainable) and classifier.reads_crops
    rows = whole(classifier, crops, jnp.asarray(PRESENT))
    np.testing.assert_allclose(fold(classifier, crops, jnp.asarray(PRESENT)), rows, atol=1e-5)
    np.testing.assert_allclose(np.exp(rows).sum(axis=1), 1.0, atol=1e-5)
    np.testing.assert_array_equal(rows[1], rows[0])  # a frame that is absent says nothing
    columns, mask = random_clip(0, time=TIME, tokens=4), jnp.broadcast_to(jnp.asarray(PRESENT)[:, None], (TIME, 4))
    np.testing.assert_allclose(classifier.logits(columns, mask, crops), rows[-1], atol=1e-6)


def test_a_clip_is_the_vote_of_its_crops():
    classifier, crops = classifier_of("b4_lite", pixels=32), some_crops(2)
    found = [classifier.network(crops.rgba[t, v][None]) for t, v in np.argwhere(COME_AND_GO & PRESENT[:, None])]
    expected = cast(jnp.stack(found), jnp.ones(len(found), bool)).logits()
    np.testing.assert_allclose(whole(classifier, crops, jnp.asarray(PRESENT))[-1], expected, atol=1e-5)


@pytest.mark.parametrize("name", KINDS)
def test_only_fused_frames_know_their_order(name):
    classifier, crops, every = classifier_of(name), random_crops(3, time=TIME, views=VIEWS), jnp.ones(TIME, bool)
    logits = jax.jit(lambda c, crops: jax.vmap(jax.vmap(c.network, in_axes=1))(crops))  # of every crop by itself
    index, there = windows_of(every, classifier.network.window)
    images = jax.image.resize(crops.rgba, (TIME, VIEWS, 16, 16, 4), "linear")
    before = logits(classifier, jnp.where(there[..., None, None, None, None], images[index], 0.0))
    after = logits(classifier, jnp.where(there[..., None, None, None, None], images[::-1][index], 0.0))[::-1]
    assert (np.abs(before - after).max() > 1e-3) == (name == "b3_lite")
    swapped = crops_of(crops.rgba[:, ::-1], crops.valid)
    np.testing.assert_allclose(whole(classifier, swapped, every), whole(classifier, crops, every), atol=1e-5)


def test_windows_end_with_their_frame_and_skip_absent_ones():
    index, there = windows_of(jnp.asarray(PRESENT), 3)
    np.testing.assert_array_equal(there[PRESENT], [[0, 0, 1], [0, 1, 1], [1, 1, 1], [1, 1, 1]])
    np.testing.assert_array_equal(index[3], [0, 2, 3])
    np.testing.assert_array_equal(index[4], [2, 3, 4])


@pytest.mark.parametrize("name", KINDS)
def test_what_does_not_count_leaves_no_trace(name):
    classifier, crops = classifier_of(name), some_crops(4)
    counts = COME_AND_GO & PRESENT[:, None]
    disturbed = crops_of(np.where(counts[..., None, None, None], crops.rgba, np.float32(np.nan)), COME_AND_GO)
    present = jnp.asarray(PRESENT)
    np.testing.assert_array_equal(whole(classifier, disturbed, present), whole(classifier, crops, present))
    empty = crops_of(np.zeros_like(crops.rgba), np.ones((TIME, VIEWS), bool))
    np.testing.assert_allclose(whole(classifier, empty, present), np.log(0.25), atol=1e-6)


@pytest.mark.parametrize("name", ["b4_lite", pytest.param("b3_lite", marks=pytest.mark.long)])
def test_training_reads_crops_that_count(name):
    classifier = classifier_of(name, dropout=0.0)
    crops = [some_crops(5), crops_of(np.ones((TIME, VIEWS, 32, 32, 4), np.float32), np.eye(TIME, VIEWS) > 0)]
    rgba, valid = jnp.stack([one.rgba for one in crops]), jnp.stack([one.valid for one in crops])
    columns, mask = random_clip(0, time=TIME, tokens=4), jnp.ones((TIME, 4), bool)

    def heads(classifier, rgba):
        def one(rgba, valid, key):
            return classifier.training_logits(columns, mask, crops_of(rgba, valid), key=key)

        return jax.vmap(one, axis_name=CLIP_AXIS)(rgba, valid, jax.random.split(jax.random.key(0), 2))

    found, slopes = jax.jit(
        lambda c, rgba: (heads(c, rgba), jax.grad(lambda c, r: jnp.sum(heads(c, r) ** 2), (0, 1))(c, rgba))
    )(classifier, rgba)
    assert found.shape == (2, 7, 4) and len(np.unique(np.round(found[0, :, 0], 4))) > 3
    norms = [float(jnp.abs(leaf).sum()) for leaf in jax.tree.leaves(slopes[0])]
    assert np.isfinite(norms).all() and all(norm > 0 for norm in norms)
    read = np.abs(slopes[1]).sum(axis=(3, 4, 5)) > 0
    assert not (read & ~np.asarray(valid)).any() and read[1].sum() >= 3


def test_a_stream_has_room_for_so_many_cameras():
    classifier, crops = classifier_of("b4_lite"), random_crops(6, time=1, views=MOST_VIEWS + 1)
    seen = jax.tree.map(lambda leaf: leaf[0], evidence(crops))
    with pytest.raises(UserError, match="cameras"):
        classifier.step(seen, jnp.ones((), bool), classifier.initial())
    with pytest.raises(UserError, match="no crops"):
        classifier.clip(Evidence(evidence(crops).gaussians), jnp.ones(1, bool))


@pytest.mark.parametrize("name", KINDS)
def test_weights_are_stored_and_read_again(name, tmp_path):
    classifier = classifier_of(name)
    save_classifier(tmp_path / "weights.safetensors", classifier)
    again = load_classifier(tmp_path / "weights.safetensors")
    assert again.card == classifier.card and again.card.rotation_invariant and again.network.pixels == 16
    np.testing.assert_array_equal(again.network.head.weight[...], classifier.network.head.weight[...])


@pytest.mark.parametrize(("field", "value"), [("pixels", 12), ("pixels", 0), ("width", 0), ("dropout", 1.0)])
def test_sizes_that_cannot_be_are_refused(field, value):
    with pytest.raises(UserError, match=field):
        B4LiteConfig(**{field: value})
