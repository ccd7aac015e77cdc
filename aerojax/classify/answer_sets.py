"""Sets of classes that hold the right one with a stated chance, for objects of families that nobody has seen.

Split conformal prediction: a set holds every class whose probability is no lower than those that the right classes of
calibration clips have but for a small share (Sadinle, Lei & Wasserman 2019, "Least ambiguous set-valued classifiers").
Clips of one family are alike, so families and not clips are what new objects are exchangeable with: every family counts
as much as any other however many clips it has, and one more, whose classes could have no probability at all, stands for
the new one (Lee, Barber & Willett 2023, "Distribution-free inference with hierarchical data", HCP). Over families drawn
as those of the calibration were, the chance is then at least the stated one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

COVERAGE = 0.9
"""Of the sets; with n families of calibration up to n / (n + 1) can be stated, and there are 21."""


@dataclass(frozen=True)
class AnswerSet:
    """Classes that an object of one of the classes could be of.

    classes: the likeliest first. coverage: share of objects of other families whose class is in their set.
    """

    classes: tuple[str, ...]
    coverage: float


def family_of(identity: str) -> str:
    """The family of an individual, whose name is the family's and a number."""
    return identity.rpartition("_")[0] or identity


def least_probability(right: Float[np.ndarray, "clip"], family: Sequence[str], *, coverage: float = COVERAGE) -> float:
    """The probability that a class needs to be in a set.

    1 - the smallest s with Σ_k Σ_i [s_ki <= s] / ((K + 1) n_k) >= coverage over K families of n_k clips each, with s_ki
    = 1 - the probability of the right class; 0, so that sets hold all classes, where there are too few families.

    Args:
        right: probability of each calibration clip's class.
        family: of each.
        coverage: stated of the sets, below 1.
    """
    _, place, count = np.unique(np.asarray(family), return_inverse=True, return_counts=True)
    weight = 1.0 / ((len(count) + 1) * count[place])
    order = np.argsort(-right, kind="stable")
    enough = np.cumsum(weight[order]) >= coverage - 1e-9
    return float(right[order][np.argmax(enough)]) if enough.any() else 0.0


def least_probabilities(
    log_probabilities: Float[np.ndarray, "clip time label"], label: Int[np.ndarray, "clip"], family: Sequence[str]
) -> Float[np.ndarray, "time"]:
    """`least_probability` after each frame.

    Args:
        log_probabilities: after each frame; clips that end are represented by their last one.
        label: their classes. family: their families.
    """
    right = np.exp(log_probabilities[np.arange(len(label)), :, label].astype(np.float64))
    return np.array([least_probability(column, family) for column in right.T])
