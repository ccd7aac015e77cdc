"""Figures of labels: accuracy, per class, agreement beyond chance, likelihood, ranking, confusion. Host-side."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from aerojax.evaluate.calibration import calibration_error


def confusion_matrix(
    predicted: Int[np.ndarray, "clip"], label: Int[np.ndarray, "clip"], classes: int
) -> Int[np.ndarray, "truth prediction"]:
    """Counts with the truth in rows."""
    counts = np.zeros((classes, classes), np.int64)
    np.add.at(counts, (label, predicted), 1)
    return counts


def label_figures(log_probabilities: Float[np.ndarray, "clip label"], label: Int[np.ndarray, "clip"]) -> dict[str, Any]:
    """Every figure of a set of predictions.

    The confusion matrix has the truth in rows; `ece` is the expected calibration error.
    The prediction is the most probable class, an exact tie goes to the lowest. A class without examples has a recall of
    NaN in JSON's stead: None; it does not enter macro-F1 or the area under the curve. The Brier score is summed over
    classes, 0..2 (Brier 1950).
    """
    classes = log_probabilities.shape[1]
    predicted = np.argmax(log_probabilities, axis=1)
    confusion = confusion_matrix(predicted, label, classes)
    truths = confusion.sum(axis=1)
    errors = np.exp(log_probabilities) - np.eye(classes)[label]
    return {
        "clips": len(label),
        "accuracy": float(np.mean(predicted == label)),
        "ece": calibration_error(log_probabilities, label),
        "nll": float(-np.mean(log_probabilities[np.arange(len(label)), label])),
        "brier": float(np.mean(np.sum(errors**2, axis=1))),
        "macro_f1": float(macro_f1(confusion)),
        "kappa": cohen_kappa(confusion),
        "mcc": gorodkin_mcc(confusion),
        "auc": macro_auc(log_probabilities, label),
        "recall": [float(h / t) if t else None for h, t in zip(np.diag(confusion), truths, strict=True)],
        "confusion": confusion.tolist(),
    }


def macro_f1(confusion: Int[np.ndarray, "*draw truth prediction"]) -> Float[np.ndarray, "*draw"]:
    """F1 = 2·hits/(truths + guesses), averaged over the classes that have examples."""
    hits = np.diagonal(confusion, axis1=-2, axis2=-1)
    truths, guesses = confusion.sum(axis=-1), confusion.sum(axis=-2)
    f1 = 2 * hits / np.maximum(truths + guesses, 1)
    return np.asarray(np.sum(f1 * (truths > 0), axis=-1) / np.maximum(np.sum(truths > 0, axis=-1), 1))


def cohen_kappa(confusion: Int[np.ndarray, "truth prediction"]) -> float | None:
    """(p_o - p_e)/(1 - p_e) (Cohen 1960); None where truth and prediction are one and the same class throughout."""
    total = confusion.sum()
    observed = np.trace(confusion) / total
    expected = confusion.sum(axis=0) @ confusion.sum(axis=1) / total**2
    return None if expected == 1 else float((observed - expected) / (1 - expected))


def gorodkin_mcc(confusion: Int[np.ndarray, "truth prediction"]) -> float:
    """Correlation of truth and prediction over all classes (Gorodkin 2004, R_K), -1..1; 0 where one is constant."""
    total, hits = float(confusion.sum()), float(np.trace(confusion))
    guesses, truths = confusion.sum(axis=0).astype(float), confusion.sum(axis=1).astype(float)
    spread = (total**2 - guesses @ guesses) * (total**2 - truths @ truths)
    return float((hits * total - guesses @ truths) / np.sqrt(spread)) if spread > 0 else 0.0


def macro_auc(score: Float[np.ndarray, "clip label"], label: Int[np.ndarray, "clip"]) -> float | None:
    """Area under the ROC curve of each class against the rest, averaged over the classes that have both, or None."""
    areas = [
        ranking_area(score[:, c], label == c) for c in range(score.shape[1]) if 0 < np.sum(label == c) < len(label)
    ]
    return float(np.mean(areas)) if areas else None


def ranking_area(score: Float[np.ndarray, "clip"], positive: Bool[np.ndarray, "clip"]) -> float:
    """Chance that a positive scores above a negative, half for equal scores (Mann & Whitney 1947, by mean ranks)."""
    _, place, count = np.unique(score, return_inverse=True, return_counts=True)
    rank = (np.cumsum(count) - (count - 1) / 2)[place]
    positives, negatives = positive.sum(), (~positive).sum()
    return float((rank[positive].sum() - positives * (positives + 1) / 2) / (positives * negatives))
