"""How `compare_classifiers` tests what it trained: windows under the rotation protocols, or whole clips."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from aerojax.classify.base import Classifier, Trainable, with_card
from aerojax.data.manifest import read_datasets
from aerojax.data.windows import Windows, read_windows
from aerojax.evaluate.ablation import VALIDATION, answers_to_json
from aerojax.evaluate.answers import prefix_log_probabilities
from aerojax.evaluate.groups import answer_folder, asked_sequences, join_answers
from aerojax.evaluate.labels import label_figures
from aerojax.evaluate.rotation_trials import RotationTrials, all_answers, figures_of
from aerojax.evaluate.rotations import draw_rotations, protocols_of
from experiments._launch.classifier_training import ClassifierTraining


@dataclass(frozen=True, kw_only=True)
class WindowTrials(RotationTrials):
    """How test clips are read.

    window: frames of a test window.
    stride: frames between the starts of two windows of a clip.
    """

    trials: int = 1
    draws: int = 500
    window: int = 8
    stride: int = 2


@dataclass(frozen=True, kw_only=True)
class ExaminedTraining(ClassifierTraining):
    """A training run and how its weights are tested.

    test: of windows, the same for every classifier, whatever it was trained on.
    datasets: that the test clips were made from; a sequence of theirs whose clip is not in the folder of its rig counts
        as wrong.
    """

    test: WindowTrials = field(default_factory=WindowTrials)
    datasets: tuple[Path, ...] = ()


def last_frames(windows: Windows) -> Windows:
    """The last real frame of every window as a window of its own."""
    each = np.arange(len(windows.label))
    last = windows.present.shape[1] - 1 - np.argmax(windows.present[:, ::-1], axis=1)
    names = ("columns", "present", "crops", "crop_valid")
    values = {name: getattr(windows, name) for name in names}
    return replace(windows, **{n: v[each, last][:, None] for n, v in values.items() if v is not None})


def _accuracy_of_last_frames(classifier: Classifier, test: Windows) -> float:
    alone = last_frames(test)
    still = np.stack([draw_rotations(name, "none", frames=1, seed=0, trial=0) for name in alone.name])
    answers = prefix_log_probabilities(classifier, alone, still)[:, -1]
    return label_figures(answers, alone.label)["accuracy"]


def examine_windows(classifier: Trainable, config: ExaminedTraining) -> dict[str, Any]:
    """Accuracy under the five protocols, of whole windows and of their last frames alone, JSON-ready."""
    plan = config.test
    tokens = classifier.card.tokens * plan.token_ensembles
    size = {"frames": config.frames, "length": plan.window, "stride": plan.stride, "tokens": tokens}
    test = read_windows(config.tests or config.clips, "test", **size)
    val = read_windows(config.validation or config.clips, "val", **size)
    figures = figures_of(all_answers(classifier, test, val, plan, lambda done, total, what: None), test, plan)
    protocols = {
        p.name: {"test": p.test}
        | {key: figures["rotations"][p.test][key]["mean"] for key in ("clip_accuracy", "video_accuracy")}
        for p in protocols_of(classifier.card.rotation, exactly_invariant=classifier.card.rotation_invariant)
    }
    clip = figures["rotations"]["none"]["clip_accuracy"]["mean"]
    last = _accuracy_of_last_frames(with_card(classifier, token_ensembles=plan.token_ensembles), test)
    sizes = {"windows": len(test.label), "identities": len(set(test.identity))}
    return {"protocols": protocols, "clip": clip, "last_frame": last, "gain": clip - last, **sizes, "figures": figures}


def examine_clips(classifier: Trainable, config: ExaminedTraining) -> dict[str, Any]:
    """The answers to whole clips of every test folder and of validation, as long as a training window, JSON-ready."""
    frames, counted = config.variation.frames, config.tests or config.clips
    plain = with_card(classifier, temperature=1.0)
    sequences = read_datasets(config.datasets).sequences if config.datasets else ()
    answers = {
        folder.name: answer_folder(
            plain, folder / "test", frames=frames, asked=asked_sequences(sequences, folder.name, "test")
        )
        for folder in (*counted, *config.also_test)
    }
    answers[VALIDATION] = join_answers(
        [answer_folder(plain, folder / "val", frames=frames) for folder in config.validation or config.clips]
    )
    every = [np.mean(answers[folder.name].predicted == answers[folder.name].label) for folder in counted]
    return {
        "counted": [folder.name for folder in counted],
        "answers": {name: answers_to_json(one) for name, one in answers.items()},
        "clip": float(np.average(every, weights=[len(answers[folder.name].label) for folder in counted])),
    }
