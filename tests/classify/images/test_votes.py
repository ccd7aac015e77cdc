"""Majority votes by hand: counts, ties by confidence, and answers in the order of the vote."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np

from aerojax.classify.images.votes import Ballot, cast, empty_ballot


def log(*rows):
    return jnp.log(jnp.asarray(rows, jnp.float32))


def test_labels_are_counted_and_not_probabilities():
    # Two lukewarm labels of class 0 outvote one certain label of class 1, whose mean probability is the highest.
    voters = log([0.4, 0.3, 0.3], [0.4, 0.3, 0.3], [0.01, 0.98, 0.01])
    ballot = cast(voters, jnp.ones(3, bool))
    np.testing.assert_array_equal(ballot.votes, [2, 1, 0])
    np.testing.assert_allclose(ballot.confidence, [0.8, 0.98, 0], rtol=1e-6)
    assert jnp.argmax(jnp.exp(voters).mean(axis=0)) == 1 and jnp.argmax(ballot.logits()) == 0


def test_ties_go_to_the_more_confident_class():
    voters = log([0.5, 0.2, 0.3], [0.1, 0.1, 0.8])
    assert jnp.argmax(cast(voters, jnp.ones(2, bool)).logits()) == 2
    assert jnp.argmax(cast(voters[::-1], jnp.ones(2, bool)).logits()) == 2


def test_no_confidence_outweighs_a_vote():
    ballot = Ballot(jnp.asarray([50.0, 49.0]), jnp.asarray([50 / 2, 49.0]))
    assert jnp.argmax(ballot.logits()) == 0


def test_who_does_not_count_has_no_vote():
    voters = log([0.7, 0.2, 0.1], [0.1, 0.8, 0.1])
    ballot = cast(voters, jnp.asarray([False, True]))
    np.testing.assert_array_equal(ballot.votes, [0, 1, 0])
    np.testing.assert_allclose(np.exp(ballot.logits()), np.array([1, 2.4, 1]) / 4.4, rtol=1e-6)
    nothing = empty_ballot(3, jnp.float32) + cast(voters, jnp.zeros(2, bool))
    np.testing.assert_allclose(np.exp(nothing.logits()), 1 / 3, rtol=1e-6)
