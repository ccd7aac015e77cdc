"""Whether what is none of the classes is called unknown, and at what price: ranking, shares, false alarms."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from aerojax.core.types import CLASSES
from aerojax.evaluate.calibration import calibration_error
from aerojax.evaluate.labels import ranking_area

RATES = (0.01, 0.05)
"""Shares of false alarms at which recall is told."""


@dataclass(frozen=True, eq=False)
class JudgedClips:
    """What a classifier said of clips.

    log_probabilities: of the classes. strangeness: distance from what it knows, of any unit.
    familiarity: share of known objects that look as strange.
    identity: individuals. group: what figures are told by, such as rigs or kinds.
    held: classes in each answer's set; None where the classifier has no sets.
    """

    log_probabilities: Float[np.ndarray, "clip label"]
    strangeness: Float[np.ndarray, "clip"]
    familiarity: Float[np.ndarray, "clip"]
    identity: tuple[str, ...]
    group: tuple[str, ...]
    held: Bool[np.ndarray, "clip label"] | None = None

    @property
    def surest(self) -> Float[np.ndarray, "clip"]:
        """Probability of the likeliest class."""
        return np.exp(self.log_probabilities.max(axis=1))


def shares_by(values: Bool[np.ndarray, "clip"], group: Sequence[str]) -> dict[str, float]:
    """Share of the clips of each group for which something holds."""
    names = np.asarray(group)
    return {str(name): float(values[names == name].mean()) for name in np.unique(names)}


def separation(known: JudgedClips, strange: JudgedClips, *, seed: int, draws: int) -> dict[str, Any]:
    """Area under the ROC curve of strangeness with its 95 % interval over individuals, and of the probability alone."""
    return {
        "auroc": _area(known.strangeness, strange.strangeness),
        "auroc_interval_95": _interval(known, strange, seed=seed, draws=draws),
        "auroc_of_probability": _area(-known.surest, -strange.surest),
    }


def _area(known: Float[np.ndarray, "known"], strange: Float[np.ndarray, "strange"]) -> float:
    return ranking_area(np.concatenate([known, strange]), np.arange(len(known) + len(strange)) >= len(known))


def _interval(known: JudgedClips, strange: JudgedClips, *, seed: int, draws: int) -> list[float]:
    """Percentiles when as many individuals of either side are drawn anew with replacement (Efron 1979)."""
    rng, sides = np.random.default_rng(seed), []
    for one in (known, strange):
        names, place = np.unique(np.asarray(one.identity), return_inverse=True)
        sides.append([one.strangeness[place == i] for i in range(len(names))])
    areas = [
        _area(*(np.concatenate([side[i] for i in rng.integers(len(side), size=len(side))]) for side in sides))
        for _ in range(draws)
    ]
    return np.quantile(areas, [0.025, 0.975]).tolist()


def rejection(known: JudgedClips, label: Int[np.ndarray, "clip"], strange: JudgedClips, level: float) -> dict[str, Any]:
    """How much is called unknown at a level of familiarity, and how good the other answers are.

    Args:
        known: clips of the classes. label: their truths.
        strange: clips of none of them.
        level: what is less familiar is called unknown.
    """
    rejected, right = known.familiarity < level, np.argmax(known.log_probabilities, axis=1) == label
    return {
        "level": level,
        "accuracy": float(right.mean()),
        "accuracy_of_answered": float(right[~rejected].mean()) if (~rejected).any() else None,
        "ece": calibration_error(known.log_probabilities, label),
        "known_called_unknown": float(rejected.mean()),
        "known_by_class": shares_by(rejected, [CLASSES[i] for i in label]),
        "known_by_group": shares_by(rejected, known.group),
        "strange_called_unknown": float((strange.familiarity < level).mean()),
        "strange_by_group": shares_by(strange.familiarity < level, strange.group),
        "strange_sure": float(((strange.familiarity >= level) & (strange.surest >= 0.5)).mean()),
    }


def set_figures(
    held: Bool[np.ndarray, "clip label"], label: Int[np.ndarray, "clip"], family: Sequence[str]
) -> dict[str, Any]:
    """How often sets of classes hold the right one, and how much they say.

    Args:
        held: classes in each clip's set. label: the right ones. family: what chances are counted over.

    Returns:
        coverage, of clips; coverage_of_families, mean over them; families; mean_size; single, share of sets of one
        class, and single_right, the share of those that are right, None where there are none.
    """
    covered, size = held[np.arange(len(label)), label], held.sum(axis=1)
    alone = covered[size == 1]
    return {
        "coverage": float(covered.mean()),
        "coverage_of_families": float(np.mean(list(shares_by(covered, family).values()))),
        "families": len(set(family)),
        "mean_size": float(size.mean()),
        "single": float(np.mean(size == 1)),
        "single_right": float(alone.mean()) if len(alone) else None,
    }


def recall_at(positive: Float[np.ndarray, "positive"], negative: Float[np.ndarray, "negative"], rate: float) -> float:
    """Share of the positives above the score that no more than `rate` of the negatives exceed."""
    allowed = int(np.floor(rate * len(negative)))
    threshold = np.sort(negative)[::-1][allowed] if allowed < len(negative) else -np.inf
    return float(np.mean(positive > threshold))


def alarms(
    known: JudgedClips, label: Int[np.ndarray, "clip"], strange: JudgedClips, level: float, *, name: str = "drone"
) -> dict[str, Any]:
    """False alarms of one class, with and without calling things unknown.

    Args:
        known, label, strange, level: as for `rejection`.
        name: of the class that alarms.

    Returns:
        `plain` and `with_unknown`, each with the recall of the class where it is the answer, the shares of other
        classes' clips and of outliers that are called it, and its recall where scores are cut so that the stated share
        of all those is.
    """
    which = CLASSES.index(name)
    found: dict[str, Any] = {"class": name}
    for key, least in (("plain", 0.0), ("with_unknown", level)):
        score: dict[str, np.ndarray] = {}
        called: dict[str, np.ndarray] = {}
        for side, one in (("known", known), ("strange", strange)):
            familiar = one.familiarity >= least
            score[side] = np.exp(one.log_probabilities[:, which]) * familiar
            called[side] = (np.argmax(one.log_probabilities, axis=1) == which) & familiar
        mine = label == which
        negative = np.concatenate([score["known"][~mine], score["strange"]])
        found[key] = {
            "recall": float(called["known"][mine].mean()),
            "other_classes": float(called["known"][~mine].mean()),
            "outliers": float(called["strange"].mean()),
            "recall_at_rate": {f"{rate:.0%}": recall_at(score["known"][mine], negative, rate) for rate in RATES},
        }
    return found


def join_judged(parts: Sequence[JudgedClips]) -> JudgedClips:
    """Several sets as one, in order."""
    return JudgedClips(
        np.concatenate([one.log_probabilities for one in parts]),
        np.concatenate([one.strangeness for one in parts]),
        np.concatenate([one.familiarity for one in parts]),
        tuple(name for one in parts for name in one.identity),
        tuple(name for one in parts for name in one.group),
        None if (sets := [one.held for one in parts if one.held is not None]) == [] else np.concatenate(sets),
    )
