"""Familiarity: distances by hand, shares that are conformal, a file that belongs to its weights."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from safetensors.numpy import save_file

from aerojax.classify.answer_sets import AnswerSet
from aerojax.classify.base import Embedding
from aerojax.classify.familiarity import (
    SHRINKAGE,
    Familiarity,
    KnownClips,
    familiarity_path,
    fit_familiarity,
    load_familiarity,
    save_familiarity,
)
from aerojax.classify.load import load_classifier
from aerojax.core.errors import UserError
from aerojax.core.tensors import read_tensors
from aerojax.core.types import Crops, Evidence, Gaussians

ROWS, CLASSES, WIDTH, TIME = 2, 3, 5, 4
WEIGHT = (0.5, 0.5)


def drawn(rng, count, *, apart=0.0):
    """Features of every class about a mean of its own, and labels; `apart` moves them where no class is."""
    label = np.arange(count) % CLASSES
    centre = np.zeros((ROWS, CLASSES, WIDTH))
    centre[:, np.arange(CLASSES), np.arange(CLASSES)] = 6.0
    x = centre[:, label].transpose(1, 0, 2) + rng.normal(size=(count, ROWS, WIDTH)) * [1.0, 2.0, 1.0, 0.5, 3.0]
    x[..., -2] += apart
    return x.astype(np.float32), label


def seen(features, present, label=None):
    """Validation clips, of families of three individuals, that are answered rightly with a probability of 0.6."""
    label = np.zeros(len(features), int) if label is None else label
    answers = np.where(np.arange(4) == label[:, None], 0.6, 0.4 / 3)[:, None].repeat(features.shape[1], axis=1)
    names = tuple(f"family_{i // 3}_{i % 3}" for i in range(len(features)))
    return KnownClips(features, np.log(answers), present, label, names)


def fitted(seed=0, count=300):
    rng = np.random.default_rng(seed)
    features, label = drawn(rng, 900)
    known = drawn(rng, count)[0][:, None].repeat(TIME, axis=1)
    return fit_familiarity(features, label, seen(known, np.ones((count, TIME), bool)), WEIGHT), rng


NO_SETS = (jnp.zeros(0), jnp.zeros(1))


@jax.jit
def shares(familiarity, features, frames):
    return jax.vmap(familiarity.share, (0, None))(features, frames)


def test_the_distance_is_that_to_the_nearest_class():
    one = Familiarity(
        jnp.array([[[0.0, 0.0], [4.0, 0.0]]]), 0.5 * jnp.eye(2)[None], jnp.ones(1), jnp.zeros((1, 1)), *NO_SETS
    )
    assert float(one.distance(jnp.array([[3.0, 2.0]]))) == pytest.approx(np.log((1.0 + 4.0) * 0.25), rel=1e-6)
    weight = jnp.array([0.75, 0.25])
    two = Familiarity(jnp.tile(one.mean, (2, 1, 1)), jnp.tile(one.whitening, (2, 1, 1)), weight, one.known, *NO_SETS)
    mean = 0.75 * np.log(1.25) + 0.25 * np.log(0.25)  # of rows that see it elsewhere
    assert float(two.distance(jnp.array([[3.0, 2.0], [0.0, 1.0]]))) == pytest.approx(mean, rel=1e-6)


def test_features_of_a_class_have_unit_covariance_after_whitening():
    found, rng = fitted()
    features, label = drawn(rng, 30_000)
    apart = np.einsum("bnf,nfg->bng", features - np.asarray(found.mean)[:, label].transpose(1, 0, 2), found.whitening)
    variance = np.array([1.0, 4.0, 1.0, 0.25, 9.0])
    expected = variance / (variance + SHRINKAGE * variance.mean())
    for row in range(ROWS):
        np.testing.assert_allclose(np.diag(np.cov(apart[:, row].T)), expected, rtol=0.15)


def test_the_share_counts_known_objects_at_least_as_far():
    known = jnp.log(jnp.array([[1.0, 2.0, 3.0, 4.0], [0.1, 0.2, 0.3, 9.0]]))
    one = Familiarity(jnp.zeros((1, 1, 1)), jnp.ones((1, 1, 1)), jnp.ones(1), known, *NO_SETS)
    at = jnp.sqrt(jnp.array([[2.5]]))
    assert float(one.share(at, 1)) == pytest.approx(3 / 5)  # 3 and 4, and itself
    assert float(one.share(at, 2)) == float(one.share(at, 7)) == pytest.approx(2 / 5)
    assert float(one.share(at * 100, 1)) == pytest.approx(1 / 5)  # never 0


def test_new_known_objects_are_rejected_at_the_stated_rate_and_strange_ones_more_often():
    familiarity, rng = fitted(count=1000)
    rejected = np.mean(np.asarray(shares(familiarity, jnp.asarray(drawn(rng, 4000)[0]), TIME)) < 0.05)
    assert rejected == pytest.approx(0.05, abs=0.015)
    strange = np.asarray(shares(familiarity, jnp.asarray(drawn(rng, 400, apart=6.0)[0]), TIME)) < 0.05
    assert strange.mean() > 0.95
    near = np.asarray(shares(familiarity, jnp.asarray(drawn(rng, 400, apart=0.0)[0]), TIME)) < 0.05
    assert near.mean() < 0.1


def test_clips_that_end_are_compared_by_their_last_frame():
    features, label = drawn(np.random.default_rng(1), 90)
    known = np.zeros((2, 3, ROWS, WIDTH), np.float32)
    known[1] += np.arange(3)[:, None, None]
    present = np.array([[True, False, False], [True, True, True]])
    known[0, 1:] = 50.0  # what is behind the end does not count
    rows = np.asarray(fit_familiarity(features, label, seen(known, present), WEIGHT).known)
    assert (np.diff(rows, axis=1) >= 0).all()
    np.testing.assert_allclose(rows[0], rows[0, 0], rtol=1e-6)
    assert rows.max() < 10
    with pytest.raises(UserError, match="the same features"):
        fit_familiarity(features[:CLASSES], label[:CLASSES], seen(known, present), WEIGHT)


def test_it_lies_beside_the_weights_that_it_belongs_to(tmp_path):
    weights, (familiarity, _) = tmp_path / "weights.safetensors", fitted()
    weights.write_bytes(b"weights")
    assert load_familiarity(weights) is None
    path = save_familiarity(weights, familiarity, {"seed": 0})
    assert path == familiarity_path(weights) == tmp_path / "weights.familiarity.safetensors"
    again = load_familiarity(weights)
    assert again is not None
    jax.tree.map(np.testing.assert_array_equal, again, familiarity)
    weights.write_bytes(b"other weights")
    with pytest.raises(UserError, match="fitted to other weights"):
        load_familiarity(weights)


def test_files_of_before_there_were_sets_give_none(tmp_path):
    weights, (familiarity, _) = tmp_path / "weights.safetensors", fitted()
    weights.write_bytes(b"weights")
    path = save_familiarity(weights, familiarity, {})
    tensors, header = read_tensors(path)
    answer = np.log(np.array([0.1, 0.62, 0.2, 0.08]))
    assert familiarity.answer_set(answer, 2) == AnswerSet(("drone",), 0.9)
    save_file({name: one for name, one in tensors.items() if name not in ("least", "coverage")}, path, metadata=header)
    before = load_familiarity(weights)
    assert before is not None and before.answer_set(answer, 2) is None


def test_what_is_broken_is_refused(tmp_path):
    weights, (familiarity, _) = tmp_path / "weights.safetensors", fitted()
    weights.write_bytes(b"weights")
    path = save_familiarity(weights, familiarity, {})
    tensors, header = read_tensors(path)
    for change in ({"mean": np.zeros(3, np.float32)}, {"whitening": np.zeros((2, 4, 4), np.float32)}):
        save_file(tensors | change, path, metadata=header)
        with pytest.raises(UserError, match="does not hold means, whitening and known distances"):
            load_familiarity(weights)
    save_file(tensors | {"known": np.full((1, 2), np.nan, np.float32)}, path, metadata=header)
    with pytest.raises(UserError, match="not finite"):
        load_familiarity(weights)


def test_the_shipped_classifier_knows_no_discs_and_no_turning_squares():
    classifier, familiarity = load_classifier(), load_familiarity()
    assert isinstance(classifier, Embedding) and familiarity is not None
    assert familiarity.weight.shape == (len(classifier.feature_weights),)
    at = np.arange(32) - 15.5
    x, y = np.meshgrid(at, at)
    turn = np.arange(16).reshape(TIME, 4, 1, 1) * 0.4
    along, aside = np.cos(turn) * x + np.sin(turn) * y, np.cos(turn) * y - np.sin(turn) * x
    inside = np.stack([np.broadcast_to(12 - np.hypot(x, y), along.shape), 9 - np.maximum(abs(along), abs(aside))])
    coverage = 1 / (1 + np.exp(-3 * np.clip(inside, -8, 8)))[..., None]
    rgba = jnp.asarray(np.concatenate([np.zeros((*coverage.shape[:-1], 3)), coverage], axis=-1), jnp.float32)

    @jax.jit
    def share(classifier, familiarity, rgba):
        seen = Evidence(Gaussians.from_columns(jnp.ones((TIME, 4, 14))), Crops(rgba, jnp.ones((TIME, 4), bool)))
        return familiarity.share(classifier.clip_features(seen, jnp.ones(TIME, bool))[1][-1], TIME)

    assert max(float(share(classifier, familiarity, one)) for one in rgba) < 0.02
