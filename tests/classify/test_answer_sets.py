"""Sets of classes: quantiles by hand, and their coverage of families that were not calibrated with."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

from aerojax.classify.answer_sets import AnswerSet, family_of, least_probabilities, least_probability
from aerojax.classify.familiarity import Familiarity
from aerojax.core.types import CLASSES


def familiarity(*least):
    fixed = (jnp.zeros((1, 1, 1)), jnp.ones((1, 1, 1)), jnp.ones(1), jnp.zeros((1, 1)))
    return Familiarity(*fixed, jnp.asarray(least, float), jnp.array([0.9]))


def test_every_family_counts_as_much_as_any_other():
    right, family = np.array([0.9, 0.8, 0.1, 0.2, 0.3, 0.4]), ["a", "b", "c", "c", "c", "c"]
    # Of a new family and three others a quarter each: 0.9 and 0.8 are half, and every clip of c adds a sixteenth.
    assert least_probability(right, family, coverage=0.5) == 0.8
    assert least_probability(right, family, coverage=0.51) == 0.4
    assert least_probability(right, family, coverage=0.6) == 0.3
    assert least_probability(right, family, coverage=0.75) == 0.1
    assert least_probability(right, family, coverage=0.76) == 0.0  # three families cannot say that


def test_thresholds_after_each_frame():
    answers = np.log(np.array([[[0.5, 0.5], [0.2, 0.8]], [[0.6, 0.4], [0.7, 0.3]]]))
    least = least_probabilities(answers, np.array([1, 0]), ["a", "b"])
    np.testing.assert_array_equal(least, [0.0, 0.0])  # of two families no nine tenths
    many = least_probabilities(np.repeat(answers, 10, axis=0), np.repeat([1, 0], 10), [str(i) for i in range(20)])
    np.testing.assert_allclose(many, [0.5, 0.7])


def test_a_set_holds_what_is_likely_enough_and_never_nothing():
    answer = np.log(np.array([0.15, 0.5, 0.3, 0.05]))
    names = tuple(CLASSES[i] for i in (1, 2, 0))
    known = familiarity(0.1, 0.29, 0.9)
    assert known.answer_set(answer, 1) == AnswerSet(names, 0.9)
    assert known.answer_set(answer, 2) == AnswerSet(names[:2], 0.9)
    assert known.answer_set(answer, 3) == known.answer_set(answer, 50) == AnswerSet(names[:1], 0.9)
    assert familiarity().answer_set(answer, 3) is None
    assert family_of("drone_whoop_02") == "drone_whoop" and family_of("ours") == "ours"


@pytest.mark.parametrize("pooled", [False, True])
def test_new_families_are_covered_as_stated_only_if_families_count(pooled):
    """Families differ: some are hard throughout, and a few have many clips. Counting clips is the negative control."""
    rng = np.random.default_rng(0)

    def draw(count):
        hard = rng.random(count) < 0.3
        clips = np.where(hard, 2, 30)  # the easy ones are many
        family = np.repeat(np.arange(count), clips)
        return np.clip(rng.normal(np.where(hard, 0.3, 0.8)[family], 0.1), 0.01, 0.99), family

    covered = []
    for _ in range(200):
        right, family = draw(21)
        names = np.arange(len(family)) if pooled else family
        new, whose = draw(20)
        inside = new >= least_probability(right, list(map(str, names)))
        covered.append(np.mean([inside[whose == one].mean() for one in range(20)]))
    if pooled:
        assert np.mean(covered) < 0.85
    else:
        assert 0.9 <= np.mean(covered) < 0.96
