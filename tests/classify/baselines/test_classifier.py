"""The baselines behind the door: votes of frames are a stream, tubes of clips give the rows of every prefix."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.clip_examples import random_clip
from support.tiny_baselines import CLIP_WISE, FRAME_WISE, TIME, TOKENS, long, tiny_classifier

from aerojax.classify.base import CLIP_AXIS, Classifier, Trainable
from aerojax.core.errors import UserError
from aerojax.core.types import Evidence, Gaussians

VALID = np.array([False, True, True, False, True, True])
ALL = np.ones(TIME, bool)


@jax.jit
def read(classifier, columns, valid):
    return classifier.clip(Evidence(Gaussians.from_columns(columns)), valid)


@jax.jit
def fold(classifier, columns, valid):
    def step(state, frame):
        logits, state = classifier.step(Evidence(Gaussians.from_columns(frame[0])), frame[1], state)
        return state, logits

    return jax.lax.scan(step, classifier.initial(), (columns, valid))[1]


@jax.jit
def network_logits(classifier, columns, valid):
    return classifier.logits(columns, jnp.broadcast_to(valid[:, None], columns.shape[:2]))


@pytest.mark.long
@pytest.mark.parametrize("name", ["vn_pointnet", *long("vn_dgcnn")])
def test_votes_are_a_stream(name):
    classifier = tiny_classifier(name, ensembles=3)  # of which two have tokens
    assert classifier.causal and isinstance(classifier, Classifier) and isinstance(classifier, Trainable)
    columns = random_clip(1, time=TIME, tokens=2 * TOKENS + 3)
    for valid in (VALID, ALL):
        rows = read(classifier, columns, jnp.asarray(valid))
        np.testing.assert_allclose(fold(classifier, columns, jnp.asarray(valid)), rows, atol=1e-5)
        np.testing.assert_allclose(np.exp(rows).sum(axis=1), 1.0, atol=1e-5)
    missing = np.asarray(read(classifier, columns, jnp.asarray(VALID)))
    np.testing.assert_allclose(missing[0], np.log(0.25), atol=1e-6)  # nothing was seen
    np.testing.assert_array_equal(missing[3], missing[2])


@pytest.mark.parametrize("name", ["vn_pointnet", *long("vn_dgcnn")])
def test_a_clip_is_the_mean_of_its_frames(name):
    classifier, columns = tiny_classifier(name), random_clip(2, time=TIME, tokens=TOKENS)
    alone = [network_logits(classifier, columns, jnp.arange(TIME) == t) for t in np.flatnonzero(VALID)]
    together = network_logits(classifier, columns, jnp.asarray(VALID))
    np.testing.assert_allclose(np.exp(together), np.mean(np.exp(alone), axis=0), atol=1e-6)
    assert np.abs(alone[0] - alone[1]).max() > 1e-4
    np.testing.assert_allclose(read(classifier, columns, jnp.asarray(VALID))[-1], together, atol=1e-5)


@pytest.mark.long
@pytest.mark.parametrize("name", ["p4transformer", *long("mamba4d")])
def test_rows_are_those_of_the_prefixes(name):
    classifier, columns = tiny_classifier(name), random_clip(3, time=TIME, tokens=TOKENS)
    for valid in (VALID, ALL):
        rows = read(classifier, columns, jnp.asarray(valid))
        for t in np.flatnonzero(np.cumsum(valid) > 0):
            prefix = network_logits(classifier, columns, jnp.asarray(valid & (np.arange(TIME) <= t)))
            np.testing.assert_allclose(rows[t], jax.nn.log_softmax(prefix), atol=1e-5, err_msg=str(t))
    assert np.abs(rows[1] - rows[5]).max() > 1e-4
    np.testing.assert_allclose(read(classifier, columns, jnp.asarray(VALID))[0], np.log(0.25), atol=1e-6)


@pytest.mark.long
@pytest.mark.parametrize("name", CLIP_WISE)
def test_absent_frames_and_tokens_leave_no_trace(name):
    classifier, columns = tiny_classifier(name), random_clip(4, time=TIME, tokens=TOKENS)
    mask = jnp.broadcast_to(jnp.asarray(VALID)[:, None], (TIME, TOKENS)).at[:, 11:].set(False)
    logits = jax.jit(lambda c, columns: c.logits(columns, mask))
    disturbed = jnp.where(mask[..., None], columns, 9.0)
    np.testing.assert_array_equal(logits(classifier, disturbed), logits(classifier, columns))


@pytest.mark.parametrize("name", CLIP_WISE)
def test_whole_clips_have_no_steps(name):
    classifier, columns = tiny_classifier(name), random_clip(5, time=TIME, tokens=TOKENS)
    assert not classifier.causal and isinstance(classifier, Trainable)
    with pytest.raises(UserError, match="whole clips alone") as error:
        classifier.step(Evidence(Gaussians.from_columns(columns[0])), jnp.ones((), bool), classifier.initial())
    assert error.value.code == "mismatch"


@pytest.mark.parametrize("name", long(*FRAME_WISE, *CLIP_WISE))
def test_heads_of_training_have_finite_slopes(name):
    classifier = tiny_classifier(name)
    clips = jnp.stack([random_clip(seed, time=TIME, tokens=TOKENS) for seed in (6, 7)])
    masks = jnp.stack([jnp.ones((TIME, TOKENS), bool), jnp.zeros((TIME, TOKENS), bool).at[2, :3].set(True)])

    def heads(classifier):
        def one(clip, mask, key):
            return classifier.training_logits(clip, mask, None, key=key)

        return jax.vmap(one, axis_name=CLIP_AXIS)(clips, masks, jax.random.split(jax.random.key(0), 2))

    assert jax.eval_shape(heads, classifier).shape == (2, TIME if name in FRAME_WISE else 1, 4)
    slope = jax.jit(jax.grad(lambda c: jnp.sum(heads(c) ** 2)))(classifier)
    norms = [float(jnp.abs(leaf).sum()) for leaf in jax.tree.leaves(slope)]
    assert np.isfinite(norms).all() and all(norm > 0 for norm in norms)
