"""One training run of a classifier with its screen and its files, for every act that trains one."""

from __future__ import annotations

import json
import time
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import jax
from rich.console import Console

from aerojax.classify.base import ClassifierConfig, Trainable, untrained, with_card
from aerojax.classify.card_markdown import card_markdown
from aerojax.classify.ensemble.config import EnsembleConfig
from aerojax.classify.load import save_classifier
from aerojax.classify.views.config import ViewsConfig
from aerojax.core.config import to_mapping
from aerojax.core.files import write_json, write_text
from aerojax.core.provenance import provenance
from aerojax.core.tensors import parameter_count
from aerojax.data.clips import ClipSet
from aerojax.data.selection import SelectionConfig, select_clips
from aerojax.evaluate.answers import load_split, require_clips, split_figures
from aerojax.pipeline.clips import settings_of
from aerojax.simulate.assets.catalogue import identities
from aerojax.training.distribution import DistributionConfig, is_first_process, join_processes
from aerojax.training.loop import TrainingConfig
from aerojax.training.memory import keep_freed_memory
from aerojax.training.tasks.classification import ClipTask, train_classifier
from aerojax.training.variation import VariationConfig
from experiments._launch.command import Run
from experiments._launch.training_screen import training_screen


@dataclass(frozen=True, kw_only=True)
class ClassifierTraining:
    """Data, model and optimisation of one training run.

    clips: folders of `generate_clips` or `reconstruct_dataset`, one a rig, each with train/, and val/ unless
        `validation` is given.
    selection: which of their training clips are learnt from; all by default.
    validation: folders whose val/ chooses the weights; empty takes those of `clips`.
    tests: folders whose test/ is counted together; empty takes those of `clips`.
    also_test: further folders whose test/ is counted apart.
    frames: clips are cut or padded to so many.
    networks: trained side by side, whose answers are averaged.
    model: the kind of classifier and its sizes; it has as many answers as its clips have classes.
    variation: of the clips from epoch to epoch. training: its length.
    tensorboard: write curves to `curves/` of the run's directory.
    distribution: the processes that train together; each needs a run directory of its own.
    """

    preset: str
    seed: int = 0
    clips: tuple[Path, ...]
    selection: SelectionConfig = field(default_factory=SelectionConfig)
    validation: tuple[Path, ...] = ()
    tests: tuple[Path, ...] = ()
    also_test: tuple[Path, ...]
    frames: int = 10
    networks: int = 1
    model: ClassifierConfig = field(default_factory=ViewsConfig)
    variation: VariationConfig = field(default_factory=VariationConfig)
    training: TrainingConfig = field(default_factory=TrainingConfig)
    tensorboard: bool = False
    distribution: DistributionConfig = field(default_factory=DistributionConfig)


def train_and_keep(config: ClassifierTraining, run: Run) -> None:
    """Train, test, and write weights with their card and `metrics.json`; of several processes the first one writes."""
    keep_freed_memory()
    join_processes(config.distribution)
    console, start = Console(quiet=not is_first_process()), time.perf_counter()
    counted = config.tests or config.clips
    require_clips((*counted, *config.also_test), "test")
    clips, val = _clips(config)
    config = replace(config, model=answering(config.model, len(clips.classes)))
    console.print(f"clips: {len(clips.label)} train, {len(val.label)} val")
    classifier = with_card(_train(config, run, console, clips, val), classes=clips.classes)
    tests = split_figures(classifier, counted, config.also_test, split="test", frames=config.frames)
    for name, figures in tests.items():
        console.print(f"test {name}: {figures['identities']} unseen identities, accuracy {figures['accuracy']:.3f}")
    results = {
        "test": tests["all"],
        "tests": tests,
        "test_identities": tests["all"]["identities"],
        "classes": clips.classes,
        "clips": list(map(str, config.clips)),
        "training_clips": len(clips.label),
        "training_identities": len(set(clips.identity)),
        "steps": config.training.epochs * config.training.passes * (len(clips.label) // config.training.batch),
        "test_clips": list(map(str, counted)),
        "trained": {name: to_mapping(getattr(config, name)) for name in ("model", "variation", "training")},
        "networks": config.networks,
        "seed": config.seed,
        "minutes": (time.perf_counter() - start) / 60,
        **provenance(run.overrides),
    }
    if is_first_process():
        console.print(str(_keep(run, classifier, results)), soft_wrap=True)


def answering(model: ClassifierConfig, classes: int) -> ClassifierConfig:
    """The model, or each part of it that answers, with so many answers."""
    if hasattr(model, "classes"):
        return replace(model, classes=classes)  # pyrefly: ignore
    parts = {part.name: getattr(model, part.name) for part in fields(model)}
    answers = {name: replace(part, classes=classes) for name, part in parts.items() if hasattr(part, "classes")}
    return replace(model, **answers)


def _clips(config: ClassifierTraining) -> tuple[ClipSet, ClipSet]:
    """The clips that a run learns from, and those of validation; with crops where the model reads them."""
    sizes = {"tokens": config.variation.tokens, "frames": config.variation.frames}
    shape = jax.eval_shape(lambda key: untrained(config.model, key=key, **sizes), jax.random.key(0))
    clips = load_split(config.clips, "train", config.frames, crops=shape.reads_crops)
    published = {one.name for one in identities("train")}
    chosen = select_clips(clips, config.selection, published=published, seed=config.seed)
    return chosen, load_split(config.validation or config.clips, "val", config.frames, crops=shape.reads_crops)


def _train(config: ClassifierTraining, run: Run, console: Console, clips: ClipSet, val: ClipSet) -> Trainable:
    task = ClipTask(clips, val, config.variation, config.training, config.seed)
    curves = run.directory / "curves" if config.tensorboard else None
    with training_screen(config.training, task.steps_per_epoch, curves=curves) as screen:
        return train_classifier(
            config.model if config.networks == 1 else EnsembleConfig(member=config.model, size=config.networks),
            task,
            settings=settings_of(config.clips[0]),
            directory=run.directory,
            report=screen.report,
            watch=screen.watch,
        )


def _keep(run: Run, classifier: Trainable, results: dict[str, Any]) -> Path:
    """Write the weights with their card, and last of all `metrics.json`; return the weights' path."""
    weights = run.directory / "weights.safetensors"
    record = {name: value for name, value in results.items() if name not in ("tests", "classes")}
    known = with_card(classifier, record=json.dumps({"command": run.command, **record}))
    save_classifier(weights, known)
    write_text(weights.with_suffix(".md"), card_markdown(known.card, parameter_count(known.network)))
    write_json(run.directory / "metrics.json", results)
    return weights
