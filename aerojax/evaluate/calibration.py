"""Whether a probability means what it says: expected calibration error, and one temperature to mend it."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

SHARPEST, BLUNTEST = 0.01, 100.0
"""Temperatures outside are not looked for: predictions that are all right would want 0, random ones infinity."""


def with_temperature(
    log_probabilities: Float[np.ndarray, "clip label"], temperature: float
) -> Float[np.ndarray, "clip label"]:
    """Log-probabilities of softmax(z/T); the order of the classes does not change (Guo et al. 2017, §4.2)."""
    scaled = log_probabilities.astype(np.float64) / temperature
    scaled = scaled - scaled.max(axis=1, keepdims=True)
    return scaled - np.log(np.exp(scaled).sum(axis=1, keepdims=True))


def fit_temperature(log_probabilities: Float[np.ndarray, "clip label"], label: Int[np.ndarray, "clip"]) -> float:
    """The temperature with the smallest negative log-likelihood, to be fitted on validation clips.

    It is convex in 1/T with slope mean(E_p[z] - z_true), so bisection on the slope's sign finds the minimum; the nearer
    of `SHARPEST` and `BLUNTEST` where it lies outside.
    """
    z = log_probabilities.astype(np.float64)
    truth = z[np.arange(len(label)), label]
    low, high = np.log(SHARPEST), np.log(BLUNTEST)
    for _ in range(60):
        middle = 0.5 * (low + high)
        p = np.exp(with_temperature(z, float(np.exp(middle))))
        if np.mean(np.sum(p * z, axis=1) - truth) > 0:
            low = middle  # the likelihood falls as 1/T grows: T must be larger
        else:
            high = middle
    return float(np.exp(0.5 * (low + high)))


def calibration_error(
    log_probabilities: Float[np.ndarray, "clip label"], label: Int[np.ndarray, "clip"], *, bins: int = 15
) -> float:
    """Expected calibration error: mean gap of accuracy and confidence over equal bins of confidence, by their shares.

    Σ_b |B_b|/n · |acc(B_b) - conf(B_b)| (Naeini et al. 2015); bin b holds confidences in (b/bins, (b+1)/bins].
    """
    confidence = np.exp(log_probabilities.astype(np.float64).max(axis=1))
    right = np.argmax(log_probabilities, axis=1) == label
    place = np.clip(np.ceil(confidence * bins).astype(int) - 1, 0, bins - 1)
    gap = np.bincount(place, weights=right - confidence, minlength=bins)
    return float(np.abs(gap).sum() / len(label))


def calibration_error_by_chance(
    log_probabilities: Float[np.ndarray, "clip label"], *, seed: int, draws: int
) -> dict[str, float]:
    """The calibration error of as many clips if the probabilities were exactly right.

    Few clips leave a gap in every bin, so that the error is never 0; labels are drawn from the probabilities themselves
    ("consistency resampling", Bröcker & Smith 2007).

    Returns:
        mean, and upper_95, which one in twenty draws exceeds.
    """
    rng, below = np.random.default_rng(seed), np.cumsum(np.exp(log_probabilities.astype(np.float64)), axis=1)
    labels = [np.sum(rng.random((len(below), 1)) * below[:, -1:] > below, axis=1) for _ in range(draws)]
    errors = [calibration_error(log_probabilities, label) for label in labels]
    return {"mean": float(np.mean(errors)), "upper_95": float(np.quantile(errors, 0.95))}
