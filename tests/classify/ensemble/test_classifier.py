"""An ensemble answers with the mean of its members and is read, streamed and stored like any classifier."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.clip_examples import random_clip
from support.crop_examples import random_crops

from aerojax.classify.base import Embedding, Trainable, untrained, with_card
from aerojax.classify.ensemble.config import EnsembleConfig
from aerojax.classify.load import load_classifier, save_classifier
from aerojax.classify.mambasplat.config import MambaSplatConfig
from aerojax.classify.views.config import ViewsConfig
from aerojax.core.errors import UserError
from aerojax.core.types import Evidence, Gaussians

TIME = 4
TINY = MambaSplatConfig(d_model=16, mamba_layers=1, depth=1, channels=4, heads=1, head_dim=4)


@jax.jit
def read(classifier: Trainable, seen: Evidence, valid):
    return classifier.clip(seen, valid)


@pytest.fixture(scope="module")
def ensemble():
    found = untrained(EnsembleConfig(member=TINY, size=3), tokens=8, frames=TIME, key=jax.random.key(0))
    return with_card(found, token_ensembles=2)


def evidence(seed):
    return Evidence(Gaussians.from_columns(random_clip(seed, time=TIME, tokens=16)))


def member_of(ensemble, index):
    one = jax.tree.map(lambda leaf: leaf[index], ensemble.members)
    return with_card(one, token_ensembles=ensemble.card.token_ensembles)


def test_the_answer_is_the_mean_of_the_members(ensemble):
    seen, valid = evidence(0), jnp.ones(TIME, bool)
    alone = [np.exp(read(member_of(ensemble, i), seen, valid)) for i in range(3)]
    np.testing.assert_allclose(np.exp(read(ensemble, seen, valid)), np.mean(alone, axis=0), atol=1e-6)
    assert np.abs(alone[0] - alone[1]).max() > 1e-4  # members differ
    cold = with_card(ensemble, temperature=0.5)
    sharp = np.mean(alone, axis=0) ** 2
    np.testing.assert_allclose(np.exp(read(cold, seen, valid)), sharp / sharp.sum(axis=1, keepdims=True), atol=1e-5)


def test_a_stream_is_the_clip(ensemble):
    seen, valid = evidence(1), jnp.array([True, False, True, True])
    rows, state, step = [], ensemble.initial(), jax.jit(lambda *inputs: ensemble.step(*inputs))
    for t in range(TIME):
        logits, state = step(jax.tree.map(lambda leaf, t=t: leaf[t], seen), valid[t], state)
        rows.append(logits)
    np.testing.assert_allclose(np.stack(rows), read(ensemble, seen, valid), atol=1e-5)


def test_features_of_a_stream_are_those_of_the_clip_and_leave_the_answer_as_it_is():
    small = ViewsConfig(width=8, hidden=8, view_width=8, d_model=16, layers=1)
    views = untrained(EnsembleConfig(member=small, size=2), tokens=8, frames=TIME, key=jax.random.key(0))
    assert isinstance(views, Embedding)
    crops = random_crops(0, time=TIME, views=3)
    seen = Evidence(Gaussians.from_columns(jnp.ones((TIME, 4, 14))), crops)
    valid = jnp.array([False, True, False, True])
    logits, features = jax.jit(lambda c, s, v: c.clip_features(s, v))(views, seen, valid)
    assert features.shape == (TIME, 4, 16) and views.feature_weights == pytest.approx((1 / 3, 1 / 6) * 2)
    assert not features[0].any()  # nothing was seen yet
    np.testing.assert_array_equal(features[2], features[1])
    assert np.abs(features[1, 0] - features[1, 2]).max() > 1e-3  # each member has its own
    np.testing.assert_array_equal(features[:, 1], features[:, 3])  # but outlines are what they are
    assert not features[:, 1, 9:].any() and features[1, 1, :9].all()
    np.testing.assert_allclose(logits, read(views, seen, valid), atol=1e-6)
    state, step = views.initial(), jax.jit(lambda *inputs: views.step_features(*inputs))
    for t in range(TIME):
        one, own, state = step(jax.tree.map(lambda leaf, t=t: leaf[t], seen), valid[t], state)
        np.testing.assert_allclose(own, features[t], atol=1e-4)  # roots near zero
        np.testing.assert_allclose(one, logits[t], atol=1e-5)


def test_every_member_learns_from_its_own_head(ensemble):
    columns, mask = random_clip(2, time=TIME, tokens=8), jnp.ones((TIME, 8), bool)

    def heads(classifier):
        return classifier.training_logits(columns, mask, None, key=jax.random.key(1))

    assert jax.eval_shape(heads, ensemble).shape == (3, 4)
    slope = jax.jit(jax.grad(lambda classifier: heads(classifier)[1, 0]))(ensemble)
    norms = [sum(float(jnp.abs(leaf[i]).sum()) for leaf in jax.tree.leaves(slope)) for i in range(3)]
    assert norms[1] > 0 and norms[0] == norms[2] == 0


def test_it_is_stored_and_read_again(ensemble, tmp_path):
    save_classifier(tmp_path / "weights.safetensors", ensemble)
    again = load_classifier(tmp_path / "weights.safetensors")
    assert again.card == ensemble.card and again.card.member == "ensemble"
    seen, valid = evidence(3), jnp.ones(TIME, bool)
    np.testing.assert_array_equal(read(again, seen, valid), read(ensemble, seen, valid))


def test_what_cannot_be_built_is_refused():
    with pytest.raises(UserError, match="size is 0"):
        EnsembleConfig(size=0)
    with pytest.raises(UserError, match="ensemble"):
        EnsembleConfig(member=EnsembleConfig())
