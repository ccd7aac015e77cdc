"""Train a reconstructor on scenes of generate_views: crops in, Gaussians out, judged by views from elsewhere."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import jax
from rich.console import Console

from aerojax.core.config import to_mapping
from aerojax.core.errors import UserError
from aerojax.core.files import write_json, write_text
from aerojax.core.tensors import parameter_count
from aerojax.data.views import ViewSet, load_views
from aerojax.evaluate.perceptual import PerceptualConfig, load_perceptual
from aerojax.reconstruct.base import ReconstructorConfig, TrainableConfig
from aerojax.reconstruct.card_markdown import card_markdown
from aerojax.reconstruct.lgm.config import LgmConfig
from aerojax.reconstruct.weights import save_reconstructor
from aerojax.training.checkpoint import latest_step
from aerojax.training.distribution import DistributionConfig, is_first_process, join_processes
from aerojax.training.loop import TrainingConfig
from aerojax.training.memory import keep_freed_memory
from aerojax.training.tasks.reconstruction import LossConfig, ReconstructionTask, SceneConfig, train_reconstructor
from experiments._launch.command import Run, experiment
from experiments._launch.training_screen import training_screen


@dataclass(frozen=True, kw_only=True)
class Config:
    """Scenes, member and optimisation of one run.

    views: folders of `generate_views`, each with train/ and val/.
    most: training scenes at most; None for all. val_scenes: of the validation scenes, so many.
    model: the member and its sizes. scenes: what is drawn of a scene. loss: what is learnt. perceptual: its network.
    training: its length.
    tensorboard: write curves to `curves/` of the run's directory.
    cpu_devices: parts of the processor that a batch is divided over, where there is no other device; much of a step
        runs on one core of each.
    distribution: the processes that train together; each needs a run directory of its own.
    """

    preset: str
    seed: int = 0
    views: tuple[Path, ...]
    most: int | None = None
    val_scenes: int = 64
    model: ReconstructorConfig = field(default_factory=LgmConfig)
    scenes: SceneConfig = field(default_factory=SceneConfig)
    loss: LossConfig = field(default_factory=LossConfig)
    perceptual: PerceptualConfig = field(default_factory=PerceptualConfig)
    training: TrainingConfig = field(default_factory=TrainingConfig)
    tensorboard: bool = False
    cpu_devices: int = 1
    distribution: DistributionConfig = field(default_factory=DistributionConfig)


def _scenes(config: Config, split: str, most: int | None) -> ViewSet:
    return load_views([folder / split for folder in config.views], most=most)


@experiment(Config, finished_by="metrics.json")
def main(config: Config, run: Run) -> None:
    """Train; write weights with what made them, and metrics.json last. Of several processes the first one writes."""
    keep_freed_memory()
    if config.cpu_devices > 1:
        jax.config.update("jax_num_cpu_devices", config.cpu_devices)
    join_processes(config.distribution)
    console, begin = Console(quiet=not is_first_process()), time.perf_counter()
    if not isinstance(config.model, TrainableConfig):
        raise UserError("mismatch", f"reconstruct={to_mapping(config.model)['name']} has nothing to train")
    train, val = _scenes(config, "train", config.most), _scenes(config, "val", config.val_scenes)
    resumed = latest_step(run.directory / "checkpoints") is not None
    console.print(f"scenes: {len(train)} train, {len(val)} val, {train.size} px")
    measure = load_perceptual(config.perceptual)
    task = ReconstructionTask(train, val, config.scenes, config.loss, config.training, config.seed, measure)
    rows: list[dict[str, float]] = []
    curves = run.directory / "curves" if config.tensorboard else None
    with training_screen(config.training, task.steps_per_epoch, curves=curves) as screen:

        def report(row: dict[str, float]) -> None:
            rows.append(row)
            screen.report(row)

        member = train_reconstructor(config.model, task, directory=run.directory, report=report, watch=screen.watch)
    if not is_first_process():
        return
    results: dict[str, Any] = {
        "validation": task.validate(member),
        "scenes": {"train": len(train), "val": len(val), "size": train.size, "views": list(map(str, config.views))},
        "parameters": parameter_count(member.network),
        "trained": {name: to_mapping(getattr(config, name)) for name in ("scenes", "loss", "perceptual", "training")},
        "seed": config.seed,
        # What an earlier run spent is not known.
        "minutes": None if resumed else (time.perf_counter() - begin) / 60,
        **run.origin,
    }
    weights = run.directory / "weights.safetensors"
    save_reconstructor(weights, member, config.model, results)
    write_text(weights.with_suffix(".md"), card_markdown(to_mapping(config.model)["name"], results))
    write_json(run.directory / "metrics.json", results)
    console.print(str(weights), soft_wrap=True)


if __name__ == "__main__":
    main()
