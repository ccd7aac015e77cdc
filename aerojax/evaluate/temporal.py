"""What the frames of a clip, their number, their order and the distance do to the answers of a trained classifier.

The analyses of the thesis' Figures 6.14 to 6.20; intervals are over individuals, and of differences on the same draws.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from aerojax.classify.base import Classifier, with_card
from aerojax.data.clips import ClipSet
from aerojax.data.windows import Windows
from aerojax.evaluate.answers import log_probabilities, prefix_log_probabilities
from aerojax.evaluate.bootstrap import bootstrap_interval
from aerojax.evaluate.labels import confusion_matrix

RANGES = {"near": (0.0, 45.0), "middle": (80.0, 170.0), "far": (170.0, 330.0)}
"""Metres from the cameras, [low, high): where radii of the published Sim-1 are up to 32, 100 and 140, 200 and 280."""


@dataclass(frozen=True)
class TemporalTrials:
    """How a classifier is asked.

    token_ensembles: disjoint token subsets of a frame whose probabilities are averaged.
    orders: random orders of each clip's frames.
    distances: metres, the ends of the groups.
    seed: of the orders and of the bootstrap. draws: of the bootstrap.
    """

    token_ensembles: int = 1
    orders: int = 10
    distances: tuple[float, ...] = (0.0, 12.0, 24.0, 45.0, 120.0, 170.0, 240.0, 330.0, 500.0)
    seed: int = 0
    draws: int = 2000


@dataclass(frozen=True, eq=False)
class TemporalAnswers:
    """What a classifier answered.

    right: whether the answer after each frame is right; repeats the last where a clip has no more frames.
    predicted: class after each frame. shuffled: share of the orders in which the whole clip is answered rightly.
    label, identity, distance: of the clips; metres, NaN if unknown.
    """

    right: Bool[np.ndarray, "clip time"]
    predicted: Int[np.ndarray, "clip time"]
    shuffled: Float[np.ndarray, "clip"]
    label: Int[np.ndarray, "clip"]
    identity: tuple[str, ...]
    distance: Float[np.ndarray, "clip"]

    @property
    def first(self) -> Float[np.ndarray, "clip"]:
        """1 where the first frame alone is answered rightly, else 0."""
        return self.right[:, 0].astype(float)

    @property
    def whole(self) -> Float[np.ndarray, "clip"]:
        """1 where the whole clip is answered rightly, else 0."""
        return self.right[:, -1].astype(float)


def windows_of(clips: ClipSet) -> Windows:
    """Whole clips as windows, one a video."""
    number = np.arange(len(clips.label))
    names = tuple(map(str, number))
    values = clips.columns, clips.present, clips.label, number, names, clips.identity
    return Windows(*values, clips.crops, clips.crop_valid, clips.classes)


def shuffled_frames(clips: ClipSet, *, seed: int) -> ClipSet:
    """The same clips with their present frames in a random order, the absent ones staying last."""
    key = np.random.default_rng(seed).random(clips.present.shape) + ~clips.present
    order, each = np.argsort(key, axis=1), np.arange(len(clips.label))[:, None]
    crops = None if clips.crops is None else clips.crops[each, order]
    valid = None if clips.crop_valid is None else clips.crop_valid[each, order]
    columns, present = clips.columns[each, order], clips.present[each, order]
    return replace(clips, columns=columns, present=present, crops=crops, crop_valid=valid)


def temporal_answers(
    classifier: Classifier, clips: ClipSet, plan: TemporalTrials, progress: Callable[[int, int, str], None]
) -> TemporalAnswers:
    """Ask after every frame, and about the whole clips with their frames shuffled.

    Args:
        classifier: read with the plan's token ensembles.
        clips: whole clips, their absent frames last.
        plan: how it is asked.
        progress: called after each pass over the clips.
    """
    classifier = with_card(classifier, token_ensembles=plan.token_ensembles)
    still = np.tile(np.array([1.0, 0.0, 0.0, 0.0]), (*clips.present.shape, 1))
    after = np.argmax(prefix_log_probabilities(classifier, windows_of(clips), still), axis=2)
    total = plan.orders + 1
    progress(1, total, f"{len(clips.label)} clips")
    hits = np.zeros(len(clips.label))
    for number in range(plan.orders):
        found = log_probabilities(classifier, shuffled_frames(clips, seed=plan.seed + number))
        hits += np.argmax(found, axis=1) == clips.label
        progress(number + 2, total, f"{len(clips.label)} clips")
    last = np.minimum(np.arange(after.shape[1]), clips.present.sum(axis=1, keepdims=True) - 1)
    after = np.take_along_axis(after, last, axis=1)
    away = np.array([float(facts.get("distance_m", np.nan)) for facts in clips.facts])
    right = after == clips.label[:, None]
    return TemporalAnswers(right, after, hits / plan.orders, clips.label, clips.identity, away)


def share(
    values: Float[np.ndarray, "clip"], sides: Float[np.ndarray, "clip"], identity: Sequence[str], plan: TemporalTrials
) -> dict[str, float]:
    """The mean of some clips' values, or the difference of two means, with the interval over individuals.

    Args:
        values: of each clip.
        sides: 1 for clips of the mean, -1 for those of the mean that is subtracted, if any, 0 for others.
        identity: of each clip; drawn anew by the bootstrap.
        plan: seed and draws.
    """
    names, place = np.unique(np.asarray(identity), return_inverse=True)
    parts = np.zeros((len(names), 2, 2))
    for column, side in enumerate((sides > 0, sides < 0)):
        np.add.at(parts[:, column, 0], place, values * side)
        np.add.at(parts[:, column, 1], place, side)

    def figure(sums: np.ndarray) -> np.ndarray:
        means = sums[..., 0] / np.where(sums[..., 1] > 0, sums[..., 1], np.nan)
        return np.asarray(means[..., 0] - (means[..., 1] if (sides < 0).any() else 0.0))

    low, high = bootstrap_interval(parts, lambda sums: _known(figure(sums)), seed=plan.seed, draws=plan.draws)
    return {"accuracy": float(figure(parts.sum(axis=0))), "low": low, "high": high}


def _known(figures: np.ndarray) -> np.ndarray:
    """Draws without a clip of a group have no figure and are left out."""
    return figures[np.isfinite(figures)]


def temporal_figures(answers: TemporalAnswers, classes: Sequence[str], plan: TemporalTrials) -> dict[str, Any]:
    """Every figure, JSON-ready: shares of right answers as `accuracy` with the ends of their 95 % intervals."""
    gain, drop = answers.whole - answers.first, answers.whole - answers.shuffled
    groups = {"all": np.ones(len(answers.label), bool)}
    groups |= {name: answers.label == number for number, name in enumerate(classes)}
    groups = {name: chosen for name, chosen in groups.items() if chosen.any()}

    def rows(values: np.ndarray) -> list[dict[str, Any]]:
        return [{"class": name, **_of(values, chosen, answers, plan)} for name, chosen in groups.items()]

    return {
        "clips": len(answers.label),
        "identities": len(set(answers.identity)),
        "prefixes": [
            {"class": name, "frames": time + 1, **_of(answers.right[:, time].astype(float), chosen, answers, plan)}
            for name, chosen in groups.items()
            for time in range(answers.right.shape[1])
        ],
        "whole": rows(answers.whole),
        "first": rows(answers.first),
        "gains": rows(gain),
        "shuffled": rows(drop),
        "gains_beside_others": [
            {"class": name, **share(gain, np.where(chosen, 1.0, -1.0), answers.identity, plan)}
            for name, chosen in groups.items()
            if not chosen.all()
        ],
        "confusion": {
            name: confusion_matrix(answers.predicted[:, time], answers.label, len(classes)).tolist()
            for name, time in (("first", 0), ("whole", -1))
        },
        **_by_distance(answers, groups, plan),
    }


def _of(values: np.ndarray, chosen: np.ndarray, answers: TemporalAnswers, plan: TemporalTrials) -> dict[str, Any]:
    return {"clips": int(chosen.sum()), **share(values, chosen.astype(float), answers.identity, plan)}


def _by_distance(answers: TemporalAnswers, groups: dict[str, np.ndarray], plan: TemporalTrials) -> dict[str, Any]:
    """By distance: whole clips, shuffled ones, and after each frame; and ranges against each other."""
    away, rows, grid = answers.distance, [], []
    for low, high in pairwise(plan.distances):
        inside = (away >= low) & (away < high)
        for name, chosen in groups.items():
            both = chosen & inside
            if both.any():
                ends = {"class": name, "from_m": low, "to_m": high}
                shuffled = float(answers.shuffled[both].mean())
                rows.append(ends | _of(answers.whole, both, answers, plan) | {"when_shuffled": shuffled})
        if inside.any():
            after = answers.right[inside].mean(axis=0)
            grid.append({"from_m": low, "to_m": high, "clips": int(inside.sum()), "accuracy": after.tolist()})
    found = {name: (away >= low) & (away < high) for name, (low, high) in RANGES.items()}
    ranges = [
        {"name": name, "from_m": RANGES[name][0], "to_m": RANGES[name][1], **_of(answers.whole, inside, answers, plan)}
        for name, inside in found.items()
        if inside.any()
    ]
    sides = found["near"].astype(float) - found["far"]
    known = bool(found["near"].any() and found["far"].any())
    return {
        "distance_m": rows,
        "frames_by_distance": grid,
        "ranges": ranges,
        "fall": share(answers.whole, sides, answers.identity, plan) if known else None,
        "gain_falls": share(answers.whole - answers.first, sides, answers.identity, plan) if known else None,
    }
