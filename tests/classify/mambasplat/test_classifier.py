"""MambaSplat behind the door: each row of a clip is the network on that prefix, by the mean of its token ensembles."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.clip_examples import random_clip

from aerojax.classify.base import Classifier, Trainable, untrained, with_card
from aerojax.classify.mambasplat.config import MambaSplatConfig, published_config
from aerojax.classify.released.normalisation import normalise_published
from aerojax.core.types import Evidence, Gaussians

TINY = {"depth": 1, "mamba_layers": 2, "d_model": 16, "channels": 4}
CONFIGS = {
    "mean": MambaSplatConfig(**TINY),
    "last": MambaSplatConfig(**TINY, readout="last"),
    "without time": MambaSplatConfig(**TINY, readout="last", temporal="none"),
    "motion": MambaSplatConfig(**TINY, motion_features=True),
    "published": published_config(**TINY),
}
VALID = np.array([False, True, True, False, False, True])
TIME, TOKENS = len(VALID), 20


def classifier_of(name, **card):
    return untrained(CONFIGS[name], tokens=8, frames=TIME, key=jax.random.key(0), **card)


@jax.jit
def read(classifier, columns, valid):
    return classifier.clip(Evidence(Gaussians.from_columns(columns)), valid)


@jax.jit
def network_of_prefixes(classifier, columns, valid):
    """Log-probabilities after each frame, every prefix encoded anew with the scale of the whole clip."""
    network = classifier.network

    def subset(columns):
        features, counts = network.frame_features(columns, jnp.broadcast_to(valid[:, None], columns.shape[:2]))
        seen = jnp.tril(jnp.ones((TIME, TIME), bool)) & counts[None]
        return jax.nn.softmax(jax.vmap(lambda mask: network.head(network.embed(features, mask)))(seen))

    subsets = columns[:, :16].reshape(TIME, 2, 8, 14)
    return jnp.log(jnp.mean(jax.vmap(subset, in_axes=1)(subsets), axis=0))


@pytest.mark.parametrize("name", CONFIGS)
def test_each_row_of_a_clip_is_the_network_on_that_prefix(name):
    classifier = classifier_of(name)
    columns = random_clip(1, time=TIME, tokens=TOKENS)
    prepared = normalise_published(columns) if name == "published" else columns
    for valid in (jnp.asarray(VALID), jnp.ones(TIME, bool), jnp.zeros(TIME, bool)):
        expected = network_of_prefixes(classifier, prepared, valid)
        np.testing.assert_allclose(read(classifier, columns, valid), expected, atol=1e-6)


def test_a_row_without_a_new_frame_repeats_the_one_before():
    rows = np.asarray(read(classifier_of("mean"), random_clip(2, time=TIME, tokens=TOKENS), jnp.asarray(VALID)))
    np.testing.assert_array_equal(rows[3], rows[2])
    assert np.abs(rows[5] - rows[4]).max() > 1e-4
    np.testing.assert_allclose(np.exp(rows).sum(axis=1), 1.0, atol=1e-5)


def test_one_ensemble_reads_the_first_tokens_alone():
    classifier = with_card(classifier_of("mean"), token_ensembles=1)
    columns, valid = random_clip(3, time=TIME, tokens=TOKENS), jnp.ones(TIME, bool)
    rows = read(classifier, columns, valid)
    np.testing.assert_array_equal(read(classifier, columns.at[:, 8:].multiply(2.0), valid), rows)
    logits = jax.jit(lambda c: c.logits(columns[:, :8], jnp.ones((TIME, 8), bool)))(classifier)
    np.testing.assert_allclose(rows[-1], jax.nn.log_softmax(logits), atol=1e-5)


def test_it_is_a_classifier_and_can_be_trained_batched_and_differentiated():
    classifier = classifier_of("mean")
    assert isinstance(classifier, Classifier) and isinstance(classifier, Trainable)
    clips = jnp.stack([random_clip(seed, time=TIME, tokens=TOKENS) for seed in (4, 5)])
    valid = jnp.asarray(np.stack([VALID, ~VALID]))
    together = jax.jit(jax.vmap(lambda c, v: classifier.clip(Evidence(Gaussians.from_columns(c)), v)))(clips, valid)
    for row, clip, mask in zip(together, clips, valid, strict=True):
        np.testing.assert_allclose(row, read(classifier, clip, mask), atol=1e-5)
    slope = jax.jit(jax.grad(lambda c: c.clip(Evidence(Gaussians.from_columns(clips[0])), valid[0])[-1, 0]))(classifier)
    assert jax.tree.structure(slope) == jax.tree.structure(classifier)
    assert all(bool(jnp.isfinite(leaf).all()) for leaf in jax.tree.leaves(slope))
