"""Figures of labels: accuracy, per class, macro-F1, likelihood, confusion. Host-side."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float, Int


def confusion_matrix(
    predicted: Int[np.ndarray, "clip"], label: Int[np.ndarray, "clip"], classes: int
) -> Int[np.ndarray, "truth prediction"]:
    """Counts with the truth in rows."""
    counts = np.zeros((classes, classes), np.int64)
    np.add.at(counts, (label, predicted), 1)
    return counts


def label_figures(log_probabilities: Float[np.ndarray, "clip label"], label: Int[np.ndarray, "clip"]) -> dict[str, Any]:
    """Accuracy, negative log-likelihood, macro-F1, recall a class and the confusion matrix (rows = truth).

    A class without examples has a recall of NaN in JSON's stead: None; it does not enter macro-F1.
    """
    classes = log_probabilities.shape[1]
    predicted = np.argmax(log_probabilities, axis=1)
    confusion = confusion_matrix(predicted, label, classes)
    hits, truths, guesses = np.diag(confusion), confusion.sum(axis=1), confusion.sum(axis=0)
    f1 = [2 * h / (t + g) for h, t, g in zip(hits, truths, guesses, strict=True) if t]
    return {
        "clips": len(label),
        "accuracy": float(np.mean(predicted == label)),
        "nll": float(-np.mean(log_probabilities[np.arange(len(label)), label])),
        "macro_f1": float(np.mean(f1)),
        "recall": [float(h / t) if t else None for h, t in zip(hits, truths, strict=True)],
        "confusion": confusion.tolist(),
    }
