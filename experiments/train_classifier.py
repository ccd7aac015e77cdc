"""Train MambaSplat-4D on simulated identities and measure it on identities that training never saw."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import jax
from rich.console import Console

from aerojax.classify.card import keep_model
from aerojax.classify.mambasplat.config import MambaSplatConfig
from aerojax.classify.mambasplat.model import MambaSplat
from aerojax.core.config import to_mapping
from aerojax.core.types import CLASSES
from aerojax.evaluate.clip_reading import load_split, test_figures
from aerojax.pipeline.clips import pipeline_of
from aerojax.training.distribution import DistributionConfig, is_first_process, join_processes
from aerojax.training.loop import TrainingConfig, fit
from aerojax.training.memory import keep_freed_memory
from aerojax.training.tasks.classification import ClipTask
from aerojax.training.variation import VariationConfig
from experiments._launch.command import Run, experiment, provenance, write_json
from experiments._launch.training_screen import training_screen


@dataclass(frozen=True)
class Config:
    """Data, model and optimisation of one training run.

    clips: folders of `reconstruct_dataset`, one a rig, each with train/, val/ and test/.
    also_test: further folders of which only test/ is used.
    frames: clips are cut or padded to so many.
    tensorboard: write curves to `curves/` of the run's directory.
    distribution: the processes that train together; each needs a run directory of its own.
    """

    preset: str
    seed: int
    clips: tuple[Path, ...]
    also_test: tuple[Path, ...]
    frames: int
    model: MambaSplatConfig
    variation: VariationConfig
    training: TrainingConfig
    tensorboard: bool = False
    distribution: DistributionConfig = field(default_factory=DistributionConfig)


def train(config: Config, run: Run) -> None:
    """Train, test, and write weights with their card and `metrics.json`; of several processes the first one writes."""
    keep_freed_memory()
    join_processes(config.distribution)
    model, results = _train_and_test(config, run)
    if is_first_process():
        Console().print(str(_keep(config, run, model, results)), soft_wrap=True)


def _train_and_test(config: Config, run: Run) -> tuple[MambaSplat, dict[str, Any]]:
    """The best model and what `metrics.json` says of it."""
    console, start = Console(quiet=not is_first_process()), time.perf_counter()
    clips, val = (load_split(config.clips, split, config.frames) for split in ("train", "val"))
    console.print(f"clips: {len(clips.label)} train, {len(val.label)} val")
    model = MambaSplat(config.model, key=jax.random.key(config.seed))
    task = ClipTask(clips, val, config.variation, config.training, config.seed)
    curves = run.directory / "curves" if config.tensorboard else None
    with training_screen(config.training, task.steps_per_epoch, curves=curves) as screen:
        todo = task.fit_task(model, screen.watch, screen.report)
        model = fit(model, todo, config.training, seed=config.seed, directory=run.directory)
    tokens = config.variation.tokens
    tests = test_figures(model, config.clips, config.also_test, frames=config.frames, tokens=tokens)
    for name, figures in tests.items():
        console.print(f"test {name}: {figures['identities']} unseen identities, accuracy {figures['accuracy']:.3f}")
    return model, {
        "test": tests["all"],
        "tests": tests,
        "test_identities": tests["all"]["identities"],
        "classes": CLASSES,
        "clips": list(map(str, config.clips)),
        "reading": {"tokens": tokens, "frames": config.variation.frames, "rotation": config.variation.rotation},
        "trained": {name: to_mapping(getattr(config, name)) for name in ("model", "variation", "training")},
        "seed": config.seed,
        "minutes": (time.perf_counter() - start) / 60,
        **provenance(run.overrides),
    }


def _keep(config: Config, run: Run, model: MambaSplat, results: dict[str, Any]) -> Path:
    """Write the weights with their card, and last of all `metrics.json`; return the weights' path."""
    notes = {name: value for name, value in results.items() if name not in ("tests", "classes")}
    notes["pipeline"] = pipeline_of(config.clips[0])
    command = " ".join([f"python -m experiments.{run.name}", *run.overrides])
    weights = keep_model(run.directory, model, notes, results, command=command)
    write_json(run.directory / "metrics.json", results)
    return weights


@experiment(Config, finished_by="metrics.json")
def main(config: Config, run: Run) -> None:
    """Train, test, and write weights with their card."""
    train(config, run)


if __name__ == "__main__":
    main()
