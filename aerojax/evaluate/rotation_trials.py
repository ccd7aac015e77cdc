"""What `eval_rotation` measures of one classifier: every test rotation and trial, prefixes, shuffled frames."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from aerojax.classify.base import Classifier, with_card
from aerojax.data.windows import Windows
from aerojax.evaluate.answers import prefix_log_probabilities, shuffled_orders, vote
from aerojax.evaluate.bootstrap import accuracy, bootstrap_interval, confusion_by_identity, paired_interval
from aerojax.evaluate.calibration import calibration_error, fit_temperature, with_temperature
from aerojax.evaluate.labels import label_figures, macro_f1
from aerojax.evaluate.rotations import TEST_ROTATIONS, TestRotation, cached_rotations


@dataclass(frozen=True)
class RotationTrials:
    """How windows are turned and read.

    seed: of the rotations and of the bootstrap.
    trials: draws of every random rotation.
    token_ensembles: disjoint token subsets of a frame whose probabilities are averaged.
    rotations: folder of the cached rotations, shared by all models.
    draws: of the bootstrap.
    """

    seed: int = 0
    trials: int = 3
    token_ensembles: int = 1
    rotations: Path = Path("data/rotations")
    draws: int = 2000


@dataclass(frozen=True)
class Answers:
    """Log-probabilities of the test windows by rotation and trial, after every frame, and with frames shuffled.

    temperature: of the validation windows; None where there were none.
    """

    turned: dict[TestRotation, list[Float[np.ndarray, "window label"]]]
    prefixes: Float[np.ndarray, "window time label"]
    shuffled: Float[np.ndarray, "window label"]
    temperature: float | None


def all_answers(
    classifier: Classifier,
    test: Windows,
    val: Windows | None,
    plan: RotationTrials,
    progress: Callable[[int, int, str], None],
) -> Answers:
    """Ask the classifier everything.

    Args:
        classifier: read with the plan's token ensembles.
        test: windows that are turned, cut and shuffled.
        val: windows that the temperature is fitted on; None fits none.
        plan: seeds, trials and where the rotations are cached.
        progress: called after each pass over the windows.
    """
    classifier = with_card(classifier, token_ensembles=plan.token_ensembles)
    done, total = 0, 2 + (val is not None) + (len(TEST_ROTATIONS) - 1) * plan.trials

    def ask(windows: Windows, kind: TestRotation, trial: int = 0, order: np.ndarray | None = None) -> np.ndarray:
        nonlocal done
        frames = windows.present.shape[1]
        turn = cached_rotations(plan.rotations, windows.name, kind, frames=frames, seed=plan.seed, trial=trial)
        found = prefix_log_probabilities(classifier, windows, turn, order=order)
        done += 1
        progress(done, total, f"{len(test.label)} windows")
        return found

    temperature = None if val is None else fit_temperature(ask(val, "none")[:, -1], val.label)
    still = ask(test, "none")
    turned: dict[TestRotation, list[np.ndarray]] = {"none": [still[:, -1]]}
    for kind in TEST_ROTATIONS[1:]:
        turned[kind] = [ask(test, kind, trial)[:, -1] for trial in range(plan.trials)]
    shuffled = ask(test, "none", order=shuffled_orders(test, seed=plan.seed))[:, -1]
    return Answers(turned, still, shuffled, temperature)


def figures_of(answers: Answers, test: Windows, plan: RotationTrials) -> dict[str, Any]:
    """Every figure of a classifier's answers, JSON-ready."""
    rotations = {
        kind: _rotation(trials, answers.turned["none"][0], answers.temperature, test, plan)
        for kind, trials in answers.turned.items()
    }
    return {
        "classes": test.classes,
        "temperature": answers.temperature,
        "rotations": rotations,
        "prefix_accuracy": _prefix_accuracy(answers.prefixes, test),
        "shuffled_frames": _levels(answers.shuffled, answers.temperature, test),
    }


def video_confusions(trials: list[np.ndarray], test: Windows) -> Int[np.ndarray, "identity truth prediction"]:
    """Confusion of the voted videos by identity, summed over trials."""
    first = test.one_a_video()
    identity = [test.identity[i] for i in first]
    votes = [np.argmax(vote(trial, test), axis=1) for trial in trials]
    return np.sum([confusion_by_identity(v, test.label[first], identity, len(test.classes)) for v in votes], axis=0)


def _rotation(
    trials: list[np.ndarray], still: np.ndarray, temperature: float | None, test: Windows, plan: RotationTrials
) -> dict[str, Any]:
    levels = [_levels(trial, temperature, test) for trial in trials]
    confusions = video_confusions(trials, test)
    changed = [np.sum(np.argmax(trial, axis=1) != np.argmax(still, axis=1)) for trial in trials]
    summary = {
        f"{level}_{name}": {"mean": float(np.mean(values)), "std": float(np.std(values))}
        for level in ("clip", "video")
        for name in ("accuracy", "macro_f1", "nll")
        for values in [[row[level][name] for row in levels]]
    }
    intervals = {
        f"video_{name}": bootstrap_interval(confusions, statistic, seed=plan.seed, draws=plan.draws)
        for name, statistic in (("accuracy", accuracy), ("macro_f1", macro_f1))
    }
    return {**summary, "interval_95": intervals, "answers_changed": int(np.sum(changed)), "trials": levels}


def _levels(log_probabilities: np.ndarray, temperature: float | None, test: Windows) -> dict[str, dict[str, Any]]:
    """Figures of windows (`clip`) and of voted videos; `ece_with_temperature` is None where there is no temperature."""
    first = test.one_a_video()
    pairs = {"clip": (log_probabilities, test.label), "video": (vote(log_probabilities, test), test.label[first])}
    return {
        level: {
            **label_figures(given, label),
            "ece": calibration_error(given, label),
            "ece_with_temperature": None
            if temperature is None
            else calibration_error(with_temperature(given, temperature), label),
        }
        for level, (given, label) in pairs.items()
    }


def _prefix_accuracy(prefixes: np.ndarray, test: Windows) -> list[dict[str, int | float]]:
    """Share of right windows after each number of frames; a window that has fewer does not count there."""
    right = np.argmax(prefixes, axis=2) == test.label[:, None]
    seen = test.present
    return [
        {"frames": t + 1, "clips": int(seen[:, t].sum()), "accuracy": float(right[seen[:, t], t].mean())}
        for t in range(seen.shape[1])
        if seen[:, t].any()
    ]


def paired_figures(
    one: tuple[Answers, Windows], other: tuple[Answers, Windows], config: RotationTrials
) -> dict[str, dict[str, float]]:
    """By test rotation: how much better one classifier's voted videos are than another's, with a paired 95 % interval.

    Args:
        one, other: answers and the windows that they are of; both of the same videos.
        config: seed and draws of the bootstrap.
    """
    rows: dict[str, dict[str, float]] = {}
    for kind in TEST_ROTATIONS:
        first, second = (video_confusions(answers.turned[kind], windows) for answers, windows in (one, other))
        low, high = paired_interval(first, second, accuracy, seed=config.seed, draws=config.draws)
        difference = float(accuracy(first.sum(0)) - accuracy(second.sum(0)))
        rows[kind] = {"difference": difference, "low": low, "high": high}
    return rows
