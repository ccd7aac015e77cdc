"""Compare classifiers: each row of a table is trained with several seeds and tested on individuals it never saw.

`python -m experiments.compare_classifiers` runs every row that conf/rows/features.yaml names, tested under the rotation
protocols and frame by frame; `rows=steps` those of an ablation of data, tokens, features and members, each of which
changes one thing; `rows=studies` parts and sizes of MambaSplat-4D; `rows=reconstructors` it on clips of two
reconstructors; `rows=baselines` it beside other networks, turned and as whole clips of every folder; `rows=images`
networks that label crops. Each leaves table.md and table.json in the sweep's directory; started again, it goes on where
it stopped.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import Any, Literal

from rich.console import Console

from aerojax.classify.base import ClassifierConfig, Trainable
from aerojax.classify.load import load_classifier
from aerojax.classify.mambasplat.config import MambaSplatConfig
from aerojax.core.config import to_mapping
from aerojax.core.files import write_json
from aerojax.core.provenance import provenance
from aerojax.core.tensors import parameter_count
from aerojax.evaluate.comparison import RESULT
from experiments._launch.classifier_examination import ExaminedTraining, examine_clips, examine_windows
from experiments._launch.classifier_training import train_and_keep
from experiments._launch.command import Run, experiment


@dataclass(frozen=True, kw_only=True)
class Config(ExaminedTraining):
    """A training run and how its weights are tested.

    rows: which table it belongs to, and so what is measured: rotations of windows, whole clips of every folder, or
        both.
    classifier: name of the row in the table, an option of conf/classifier.
    change: what the row changes. against: name of the row that it changes that of, and is held against.
    model: MambaSplat, whose features and bridges are compared, unless the row names another member.
    """

    rows: Literal["features", "steps", "baselines", "studies", "reconstructors", "images"]
    classifier: str
    change: str = ""
    against: str = ""
    model: ClassifierConfig = field(default_factory=MambaSplatConfig)


def _head(classifier: Trainable, config: Config) -> dict[str, Any]:
    """What the tables say of a row besides what was measured."""
    head = {name: getattr(config, name) for name in ("rows", "classifier", "change", "against", "seed")}
    head |= {"member": classifier.card.member, "label": classifier.card.name}
    head |= {"parameters": parameter_count(classifier.network), "trained": classifier.card.rotation}
    head |= {"frames": config.variation.frames, "tokens": config.variation.tokens}
    model = to_mapping(config.model)
    return head | {name: model[name] for name in ("mode", "bridge", "temporal") if name in model}


def _examined(classifier: Trainable, config: Config) -> dict[str, Any]:
    """What was measured; of baselines, `clip` is the accuracy of whole clips."""
    windows = {} if config.rows not in ("features", "baselines") else examine_windows(classifier, config)
    return windows | ({} if config.rows == "features" else examine_clips(classifier, config))


@experiment(Config, finished_by=RESULT)
def main(config: Config, run: Run) -> None:
    """Train one classifier, or go on with it, and write its figures."""
    metrics = run.directory / "metrics.json"
    if not metrics.is_file():
        train_and_keep(config, run)
    trained = json.loads(metrics.read_text())
    classifier = load_classifier(run.directory / "weights.safetensors")
    head = _head(classifier, config)
    head |= {name: trained[name] for name in ("training_clips", "training_identities", "steps", "minutes")}
    results = _examined(classifier, config)
    write_json(run.directory / RESULT, {**head, **results, **provenance(run.overrides)})
    Console().print(f"{config.classifier}, seed {config.seed}: clips {100 * results['clip']:.1f} %", soft_wrap=True)


if __name__ == "__main__":
    main()
