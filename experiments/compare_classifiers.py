"""Compare classifiers: each is trained with several seeds and tested under every rotation protocol and frame by frame.

`python -m experiments.compare_classifiers -m preset=small` runs every classifier that conf/compare_classifiers.yaml
names and leaves table.md and table.json in the sweep's directory; started again, it goes on where it stopped.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from typing import Any

import jax
import numpy as np
from rich.console import Console

from aerojax.evaluate.comparison import RESULT
from aerojax.evaluate.labels import label_figures
from aerojax.evaluate.rotation_figures import Reading, figures_of, read_all
from aerojax.evaluate.rotations import draw_rotations, protocols_of
from aerojax.evaluate.windows import Classifier, Windows, read_classifier, read_prefixes, read_windows
from experiments import train_classifier
from experiments._launch.command import Run, experiment, provenance, write_json


@dataclass(frozen=True, kw_only=True)
class WindowReading(Reading):
    """How test clips are read.

    window: frames of a test window.
    stride: frames between the starts of two windows of a clip.
    """

    window: int
    stride: int


@dataclass(frozen=True, kw_only=True)
class Config(train_classifier.Config):
    """A training run and how its weights are tested.

    classifier: name of the row in the table, an option of conf/classifier.
    reading: the same for every classifier, whatever it was trained on.
    """

    classifier: str
    reading: WindowReading


def last_frames(windows: Windows) -> Windows:
    """The last real frame of every window as a window of its own."""
    each = np.arange(len(windows.label))
    last = windows.present.shape[1] - 1 - np.argmax(windows.present[:, ::-1], axis=1)
    columns, present = windows.columns[each, last][:, None], windows.present[each, last][:, None]
    return replace(windows, columns=columns, present=present)


def _accuracy_of_last_frames(classifier: Classifier, test: Windows, readings: int) -> float:
    alone = last_frames(test)
    still = np.stack([draw_rotations(name, "none", frames=1, seed=0, trial=0) for name in alone.name])
    answers = read_prefixes(classifier, alone, still, readings=readings)[:, -1]
    return label_figures(answers, alone.label)["accuracy"]


def examine(classifier: Classifier, config: Config) -> dict[str, Any]:
    """Accuracy under the five protocols, of whole windows and of their last frames alone, JSON-ready."""
    reading = config.reading
    tokens = classifier.tokens * reading.readings
    size = {"frames": config.frames, "length": reading.window, "stride": reading.stride, "tokens": tokens}
    test, val = (read_windows(config.clips, split, **size) for split in ("test", "val"))
    figures = figures_of(read_all(classifier, test, val, reading, lambda: None), test, reading)
    protocols = {
        p.name: {"test": p.test}
        | {key: figures["rotations"][p.test][key]["mean"] for key in ("clip_accuracy", "video_accuracy")}
        for p in protocols_of(classifier.rotation, exactly_invariant=classifier.model.config.variant == "exact")
    }
    clip = figures["rotations"]["none"]["clip_accuracy"]["mean"]
    last = _accuracy_of_last_frames(classifier, test, reading.readings)
    sizes = {"windows": len(test.label), "identities": len(set(test.identity))}
    return {"protocols": protocols, "clip": clip, "last_frame": last, "gain": clip - last, **sizes, "figures": figures}


@experiment(Config, finished_by=RESULT)
def main(config: Config, run: Run) -> None:
    """Train one classifier, or go on with it, and write its figures."""
    metrics = run.directory / "metrics.json"
    if not metrics.is_file():
        train_classifier.train(config, run)
    trained = json.loads(metrics.read_text())
    classifier = read_classifier(run.directory / "weights.safetensors")
    results = examine(classifier, config)
    model = classifier.model.config
    head = {"classifier": config.classifier, "mode": model.mode, "bridge": model.bridge, "temporal": model.temporal}
    head |= {"parameters": sum(leaf.size for leaf in jax.tree.leaves(classifier.model)), "seed": config.seed}
    head |= {"trained": classifier.rotation, "minutes": trained["minutes"]}
    write_json(run.directory / RESULT, {**head, **results, **provenance(run.overrides)})
    Console().print(
        f"{config.classifier}, seed {config.seed}: clips {100 * results['clip']:.1f} %, "
        f"last frames alone {100 * results['last_frame']:.1f} %"
    )


if __name__ == "__main__":
    main()
