"""How much of the class colours alone give away: statistics of pixels, two classifiers, and chance by permutation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

HUES, SATURATIONS, VALUES = 12, 6, 6
NEIGHBOURS = 5
RIDGE = 10.0
"""Penalty on the weights of standardised statistics, of which there are 33."""

Answer = Callable[[Int[np.ndarray, "train"]], Int[np.ndarray, "test"]]
"""Labels of the training samples in, labels of the test samples out."""

Classifier = Callable[[Float[np.ndarray, "train feature"], Float[np.ndarray, "test feature"]], Answer]
"""What does not depend on the labels is done once, because chance asks for many of them."""


@dataclass(frozen=True)
class Leak:
    """What a classifier reaches and what it reaches by chance.

    accuracy: share of the test samples. balanced: mean over classes of the recall.
    chance: mean of the balanced accuracy with permuted training labels; interval: its central 95 %.
    probability: share of the permutations that reach at least the balanced accuracy.
    """

    accuracy: float
    balanced: float
    chance: float
    interval: tuple[float, float]
    probability: float


def colour_statistics(srgb: Float[np.ndarray, "pixel 3"]) -> Float[np.ndarray, "33"]:
    """Mean, covariance, and histograms of hue (weighted by saturation), saturation and value; no geometry.

    Args:
        srgb: an object's pixels, 0..1, at least one.
    """
    mean, centred = srgb.mean(axis=0), srgb - srgb.mean(axis=0)
    covariance = (centred.T @ centred / len(srgb))[np.triu_indices(3)]
    value, spread = srgb.max(axis=1), np.ptp(srgb, axis=1)
    saturation = spread / value.clip(1e-6)
    r, g, b = srgb.T
    gap = spread.clip(1e-6)
    sector = np.select([value == r, value == g], [(g - b) / gap, 2 + (b - r) / gap], 4 + (r - g) / gap)
    hue = (sector / 6) % 1.0
    histograms = (
        np.histogram(hue, HUES, (0, 1), weights=saturation)[0],
        np.histogram(saturation, SATURATIONS, (0, 1.001))[0],
        np.histogram(value, VALUES, (0, 1.001))[0],
    )
    return np.concatenate([mean, covariance, *(h / len(srgb) for h in histograms)])


def nearest_neighbours(train: Float[np.ndarray, "train feature"], test: Float[np.ndarray, "test feature"]) -> Answer:
    """The commonest label of the nearest training samples, each class weighted by its rarity."""
    squared = (train**2).sum(axis=1) - 2 * test @ train.T
    near = np.argsort(squared, axis=1, kind="stable")[:, :NEIGHBOURS]

    def answer(labels: Int[np.ndarray, "train"]) -> Int[np.ndarray, "test"]:
        counts = np.bincount(labels)
        votes = [(labels[near] == c).sum(axis=1) / max(int(count), 1) for c, count in enumerate(counts)]
        return np.stack(votes, axis=1).argmax(axis=1)

    return answer


def ridge(train: Float[np.ndarray, "train feature"], test: Float[np.ndarray, "test feature"]) -> Answer:
    """Regularised least squares on one indicator a class, classes weighted equally."""

    def answer(labels: Int[np.ndarray, "train"]) -> Int[np.ndarray, "test"]:
        counts = np.bincount(labels)
        weight = (len(labels) / len(counts) / counts.clip(1))[labels][:, None]
        centre = (train * weight).mean(axis=0)
        inside = train - centre
        target = np.eye(len(counts))[labels] - 1 / len(counts)
        gram = inside.T @ (weight * inside) + RIDGE * np.eye(train.shape[1])
        return ((test - centre) @ np.linalg.solve(gram, inside.T @ (target * weight))).argmax(axis=1)

    return answer


CLASSIFIERS: dict[str, Classifier] = {"nearest_neighbours": nearest_neighbours, "ridge": ridge}


def balanced_accuracy(truth: Int[np.ndarray, "sample"], answer: Int[np.ndarray, "sample"]) -> float:
    """Mean over the classes in `truth` of the share that is answered right."""
    return float(np.mean([np.mean(answer[truth == c] == c) for c in np.unique(truth)]))


def measure_leak(
    classify: Classifier,
    train: tuple[Float[np.ndarray, "train feature"], Int[np.ndarray, "train"], Int[np.ndarray, "train"]],
    test: tuple[Float[np.ndarray, "test feature"], Int[np.ndarray, "test"]],
    *,
    permutations: int,
    seed: int,
) -> Leak:
    """Train a classifier on colour statistics, test it, and compare with training on permuted labels.

    Args:
        classify: one of `CLASSIFIERS`.
        train: statistics, labels (0..) and which individual each sample shows; labels are permuted by individual,
            because views of one are alike.
        test: statistics and labels of other individuals.
        permutations: how often chance is drawn.
        seed: of the permutations.
    """
    features, labels, individual = train
    centre, scale = features.mean(axis=0), features.std(axis=0).clip(1e-6)
    known, unknown = (features - centre) / scale, (test[0] - centre) / scale
    answer_to = classify(known, unknown)
    answer = answer_to(labels)
    reached = balanced_accuracy(test[1], answer)
    _, first, which = np.unique(individual, return_index=True, return_inverse=True)
    rng = np.random.default_rng(seed)
    shuffled = (rng.permutation(labels[first])[which] for _ in range(permutations))
    chance = np.array([balanced_accuracy(test[1], answer_to(labels)) for labels in shuffled])
    low, high = (float(v) for v in np.quantile(chance, (0.025, 0.975)))
    probability = float((1 + (chance >= reached).sum()) / (1 + permutations))
    return Leak(float(np.mean(answer == test[1])), reached, float(chance.mean()), (low, high), probability)
