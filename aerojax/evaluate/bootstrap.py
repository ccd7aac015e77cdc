"""Intervals by resampling identities: clips of one identity are alike, so identities are what a test set counts."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float, Int, Real

from aerojax.evaluate.labels import confusion_matrix

Statistic = Callable[[np.ndarray], np.ndarray]
"""Confusion matrices (draw, truth, prediction) -> one figure a draw."""


def accuracy(confusion: Int[np.ndarray, "*draw truth prediction"]) -> Float[np.ndarray, "*draw"]:
    """Share on the diagonal."""
    return np.asarray(np.trace(confusion, axis1=-2, axis2=-1) / confusion.sum(axis=(-2, -1)))


def confusion_by_identity(
    predicted: Int[np.ndarray, "clip"], label: Int[np.ndarray, "clip"], identity: Sequence[str], classes: int
) -> Int[np.ndarray, "identity truth prediction"]:
    """One confusion matrix an identity, in the order of their names."""
    names, place = np.unique(np.asarray(identity), return_inverse=True)
    rows = [confusion_matrix(predicted[place == i], label[place == i], classes) for i in range(len(names))]
    return np.stack(rows)


def bootstrap_interval(
    confusions: Real[np.ndarray, "identity truth prediction"],
    statistic: Statistic,
    *,
    seed: int,
    draws: int = 2000,
    level: float = 0.95,
) -> tuple[float, float]:
    """Percentile interval of a figure when as many identities are drawn anew with replacement (Efron 1979)."""
    return _percentiles(statistic(_drawn(confusions, seed, draws)), level)


def paired_interval(
    first: Real[np.ndarray, "identity truth prediction"],
    second: Real[np.ndarray, "identity truth prediction"],
    statistic: Statistic,
    *,
    seed: int,
    draws: int = 2000,
    level: float = 0.95,
) -> tuple[float, float]:
    """Interval of the figure of `first` less that of `second`, both on the same drawn identities.

    The two models must have answered for the same identities in the same order; what makes an identity hard for both
    then cancels, and the interval is narrower than that of either.
    """
    difference = statistic(_drawn(first, seed, draws)) - statistic(_drawn(second, seed, draws))
    return _percentiles(difference, level)


def _drawn(confusions: Real[np.ndarray, "identity truth prediction"], seed: int, draws: int) -> np.ndarray:
    count = len(confusions)
    times = np.random.default_rng(seed).multinomial(count, np.full(count, 1 / count), size=draws)
    return np.einsum("di,itp->dtp", times, confusions)


def _percentiles(figures: Float[np.ndarray, "draw"], level: float) -> tuple[float, float]:
    low, high = np.quantile(figures, [(1 - level) / 2, (1 + level) / 2])
    return float(low), float(high)
