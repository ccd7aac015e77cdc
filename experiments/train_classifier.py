"""Train MambaSplat-4D on simulated identities and measure it on identities that training never saw."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
from rich.console import Console

from aerojax.classify.config import MambaSplatConfig
from aerojax.classify.mambasplat import MambaSplat
from aerojax.evaluate.labels import label_figures
from aerojax.training.data import ClipSet, VariationConfig, epoch_order, vary_clip
from aerojax.training.loop import Fit, TrainingConfig, fit, smoothed_cross_entropy
from aerojax.types import CLASSES
from experiments.clip_factory import pipeline_of
from experiments.clip_reading import load_split, predict, test_figures
from experiments.launch import Run, experiment, provenance, write_json
from experiments.model_card import keep_model
from experiments.progress import progress_bar


@dataclass(frozen=True)
class Config:
    """Data, model and optimisation of one training run.

    clips: folders of `reconstruct_dataset`, one a rig, each with train/, val/ and test/.
    also_test: further folders of which only test/ is used.
    frames: clips are cut or padded to so many.
    """

    preset: str
    seed: int
    clips: tuple[Path, ...]
    also_test: tuple[Path, ...]
    frames: int
    model: MambaSplatConfig
    variation: VariationConfig
    training: TrainingConfig


def _task(config: Config, train: ClipSet, val: ClipSet, report: Any) -> Fit:
    def loss(model: MambaSplat, batch: Any, key: jax.Array) -> jax.Array:
        columns, present, label = batch
        vary, drop = jax.random.split(key)
        one = partial(vary_clip, config=config.variation)
        clips, mask = jax.vmap(lambda c, p, k: one(c, p, key=k))(columns, present, jax.random.split(vary, len(label)))
        logits = jax.vmap(lambda c, m, k: model(c, m, key=k))(clips, mask, jax.random.split(drop, len(label)))
        return jnp.mean(smoothed_cross_entropy(logits, label, config.training.label_smoothing))

    def batches(epoch: int) -> Any:
        for index in epoch_order(len(train.label), config.training.batch, seed=config.seed, epoch=epoch):
            yield train.columns[index], train.present[index], train.label[index]

    def validate(model: MambaSplat) -> dict[str, float]:
        figures = label_figures(predict(model, val, config.variation.tokens), val.label)
        # Accuracy of a few dozen clips is coarse; the likelihood breaks its ties.
        return {
            "accuracy": figures["accuracy"],
            "nll": figures["nll"],
            "score": figures["accuracy"] - 0.1 * figures["nll"],
        }

    return Fit(loss, batches, len(train.label) // config.training.batch, validate, report)


@experiment(Config)
def main(config: Config, run: Run) -> None:
    """Train, test, and write weights with their card."""
    console, start = Console(), time.perf_counter()
    train, val = (load_split(config.clips, split, config.frames) for split in ("train", "val"))
    console.print(f"clips: {len(train.label)} train, {len(val.label)} val")
    model = MambaSplat(config.model, key=jax.random.key(config.seed))
    with progress_bar() as bar:
        epochs = bar.add_task("epochs", total=config.training.epochs)

        def report(row: dict[str, float]) -> None:
            bar.update(epochs, completed=row["epoch"])
            console.print("  ".join(f"{name} {value:.4g}" for name, value in row.items()))

        task = _task(config, train, val, report)
        model = fit(model, task, config.training, seed=config.seed, directory=run.directory)
    tests = test_figures(model, config.clips, config.also_test, frames=config.frames, tokens=config.variation.tokens)
    minutes = (time.perf_counter() - start) / 60
    for name, figures in tests.items():
        console.print(f"test {name}: {figures['identities']} unseen identities, accuracy {figures['accuracy']:.3f}")
    origin = {**provenance(run.overrides), "seed": config.seed, "minutes": minutes}
    origin["test_identities"] = tests["all"]["identities"]
    results = {
        "test": tests["all"],
        "tests": tests,
        "classes": CLASSES,
        "clips": list(map(str, config.clips)),
        **origin,
    }
    write_json(run.directory / "metrics.json", results)
    reading = {"tokens": config.variation.tokens, "frames": config.variation.frames}
    notes = {"reading": reading, "pipeline": pipeline_of(config.clips[0]), "test": tests["all"], **origin}
    command = " ".join(["python -m experiments.train_classifier", *run.overrides])
    console.print(str(keep_model(run.directory, model, notes, results, command=command)), soft_wrap=True)


if __name__ == "__main__":
    main()
