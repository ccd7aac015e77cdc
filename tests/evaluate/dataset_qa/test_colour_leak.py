"""Colour statistics by hand, and the measure of the leak on data with and without one."""

from __future__ import annotations

import numpy as np
import pytest

from aerojax.evaluate.dataset_qa.colour_leak import (
    CLASSIFIERS,
    HUES,
    SATURATIONS,
    VALUES,
    balanced_accuracy,
    colour_statistics,
    measure_leak,
)


def test_statistics_of_two_colours():
    pixels = np.array([[1.0, 0.0, 0.0], [0.0, 0.5, 0.0]])
    found = colour_statistics(pixels)
    assert found[:3] == pytest.approx([0.5, 0.25, 0.0])
    assert found[3:9] == pytest.approx([0.25, -0.125, 0.0, 0.0625, 0.0, 0.0])
    hue, saturation, value = np.split(found[9:], [HUES, HUES + SATURATIONS])
    assert hue[[0, HUES // 3]] == pytest.approx([0.5, 0.5]) and hue.sum() == pytest.approx(1.0)
    assert saturation[-1] == pytest.approx(1.0)
    assert value[[VALUES // 2 - 1, VALUES - 1]].sum() == pytest.approx(1.0) and value[-1] == pytest.approx(0.5)


def test_statistics_of_grey_pixels_have_no_hue():
    found = colour_statistics(np.full((5, 3), 0.4))
    assert np.isfinite(found).all()
    assert found[9 : 9 + HUES].sum() == 0 and found[9 + HUES] == 1


def test_statistics_forget_where_pixels_are():
    pixels = np.random.default_rng(0).uniform(size=(300, 3))
    assert colour_statistics(pixels[::-1]) == pytest.approx(colour_statistics(pixels))


def test_balanced_accuracy_weighs_classes_equally():
    truth, answer = np.array([0, 0, 0, 1]), np.array([0, 0, 0, 0])
    assert balanced_accuracy(truth, answer) == pytest.approx(0.5)


def _samples(rng: np.random.Generator, leak: float, count: int):
    """Individuals of four classes in unequal numbers, two views of each; `leak` raises four features of each class."""
    individual = np.repeat(np.arange(count), 2)
    labels = np.repeat(rng.permutation(np.arange(count) % 7 % 4), 2)
    features = np.repeat(rng.normal(size=(count, 33)), 2, axis=0) + 0.1 * rng.normal(size=(2 * count, 33))
    for step in range(4):
        features[np.arange(2 * count), 8 * labels + step] += leak
    return features, labels, individual


@pytest.mark.parametrize("name", sorted(CLASSIFIERS))
def test_a_leak_is_found_and_its_absence_too(name):
    rng = np.random.default_rng(3)
    train, (features, labels, _) = _samples(rng, 3.0, 84), _samples(rng, 3.0, 42)
    leaky = measure_leak(CLASSIFIERS[name], train, (features, labels), permutations=99, seed=0)
    assert leaky.balanced > max(0.7, leaky.interval[1]) and leaky.probability == pytest.approx(0.01)
    train, (features, labels, _) = _samples(rng, 0.0, 84), _samples(rng, 0.0, 42)
    tight = measure_leak(CLASSIFIERS[name], train, (features, labels), permutations=99, seed=0)
    assert tight.interval[0] <= tight.balanced <= tight.interval[1] and tight.probability > 0.02
    assert tight.chance == pytest.approx(0.25, abs=0.05)
