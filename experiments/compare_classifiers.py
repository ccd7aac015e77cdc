"""Compare classifiers: each is trained with several seeds and tested under every rotation protocol and frame by frame.

`python -m experiments.compare_classifiers -m preset=small` runs every classifier that conf/compare_classifiers.yaml
names and leaves table.md and table.json in the sweep's directory; started again, it goes on where it stopped.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from rich.console import Console

from aerojax.classify.base import Classifier, ClassifierConfig, with_card
from aerojax.classify.load import load_classifier
from aerojax.classify.mambasplat.config import MambaSplatConfig
from aerojax.core.files import write_json
from aerojax.core.provenance import provenance
from aerojax.core.tensors import parameter_count
from aerojax.data.windows import Windows, read_windows
from aerojax.evaluate.answers import prefix_log_probabilities
from aerojax.evaluate.comparison import RESULT
from aerojax.evaluate.labels import label_figures
from aerojax.evaluate.rotation_trials import RotationTrials, all_answers, figures_of
from aerojax.evaluate.rotations import draw_rotations, protocols_of
from experiments._launch.classifier_training import ClassifierTraining, train_and_keep
from experiments._launch.command import Run, experiment


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
class Config(ClassifierTraining):
    """A training run and how its weights are tested.

    classifier: name of the row in the table, an option of conf/classifier.
    model: MambaSplat, whose features and bridges are compared.
    test: the same for every classifier, whatever it was trained on.
    """

    classifier: str
    model: ClassifierConfig = field(default_factory=MambaSplatConfig)
    test: WindowTrials = field(default_factory=WindowTrials)


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


def examine(classifier: Classifier, config: Config) -> dict[str, Any]:
    """Accuracy under the five protocols, of whole windows and of their last frames alone, JSON-ready."""
    plan = config.test
    tokens = classifier.card.tokens * plan.token_ensembles
    size = {"frames": config.frames, "length": plan.window, "stride": plan.stride, "tokens": tokens}
    test, val = read_windows(config.tests or config.clips, "test", **size), read_windows(config.clips, "val", **size)
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


@experiment(Config, finished_by=RESULT)
def main(config: Config, run: Run) -> None:
    """Train one classifier, or go on with it, and write its figures."""
    metrics = run.directory / "metrics.json"
    if not metrics.is_file():
        train_and_keep(config, run)
    trained = json.loads(metrics.read_text())
    classifier = load_classifier(run.directory / "weights.safetensors")
    results = examine(classifier, config)
    model = dict(classifier.card.config)
    head = {"classifier": config.classifier, **{name: model[name] for name in ("mode", "bridge", "temporal")}}
    head |= {"parameters": parameter_count(classifier.network), "seed": config.seed}
    head |= {"trained": classifier.card.rotation, "minutes": trained["minutes"]}
    write_json(run.directory / RESULT, {**head, **results, **provenance(run.overrides)})
    Console().print(
        f"{config.classifier}, seed {config.seed}: clips {100 * results['clip']:.1f} %, "
        f"last frames alone {100 * results['last_frame']:.1f} %"
    )


if __name__ == "__main__":
    main()
