"""Train and test the 2D baselines that find the object in whole images: B1-lite, B2-lite and B3-lite (thesis §5.7.2).

They learn from rendered sequences of a data set's train/ and are asked about its test/. A sequence's answer is the
majority of the labels of all its images. `detector.frames=5` is B3-lite; `weights=FILE tracker=csrt` is B2-lite:
B1-lite with a tracker that carries labels over images in which nothing is detected.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import jax
from rich.console import Console

from aerojax.classify.images.detector import Detector, DetectorConfig, most_certain
from aerojax.classify.images.tracked import csrt_trackers
from aerojax.classify.images.weights import load_detector, save_detector
from aerojax.core.config import to_mapping
from aerojax.core.files import write_json
from aerojax.core.tensors import parameter_count
from aerojax.data.frame_images import FrameImages, ImageChoice, read_frame_images
from aerojax.data.manifest import SequenceEntry, read_datasets
from aerojax.evaluate.groups import answer_figures, grouped_figures
from aerojax.training.loop import Fit, TrainingConfig, fit
from aerojax.training.tasks.detection import DetectionLossConfig, DetectionTask
from experiments._detectors.answers import ask_detector, spread_sequences
from experiments._launch.command import Run, experiment
from experiments._launch.progress import progress_bar, shown_in
from experiments._launch.training_screen import training_screen


@dataclass(frozen=True, kw_only=True)
class Config:
    """Images, network and optimisation of one run, and how a sequence is answered.

    dataset: folder of `generate_dataset`.
    weights: of an earlier run, tested without training; null trains.
    detector: sizes of the network; of weights their own.
    learn: images of a sequence to learn from. ask: images of a test sequence that have a vote.
    per_rig: sequences of each rig and split at most, evenly spread; 0 for all.
    tracker: what carries labels over images without a detection: nothing, or csrt.
    least: confidence below which nothing counts as detected.
    loss: what is learnt. training: its length. draws: of the bootstrap.
    """

    preset: str
    seed: int = 0
    dataset: Path
    weights: Path | None = None
    detector: DetectorConfig = field(default_factory=DetectorConfig)
    learn: ImageChoice = field(default_factory=ImageChoice)
    ask: ImageChoice = field(default_factory=ImageChoice)
    per_rig: int = 0
    tracker: Literal["none", "csrt"] = "none"
    least: float = 0.05
    loss: DetectionLossConfig = field(default_factory=DetectionLossConfig)
    training: TrainingConfig = field(default_factory=TrainingConfig)
    draws: int = 2000


def _sequences(config: Config, split: str) -> list[SequenceEntry]:
    return spread_sequences(read_datasets([config.dataset]).sequences, split, config.per_rig)


def _images(config: Config, size: DetectorConfig, split: str, choice: ImageChoice) -> FrameImages:
    with progress_bar("/s") as bar:
        pixels, ask = (size.height, size.width), {"window": size.frames, "seed": config.seed}
        return read_frame_images(_sequences(config, split), choice, size=pixels, **ask, progress=shown_in(bar))


def _trained(config: Config, run: Run) -> Detector:
    train, val = (_images(config, config.detector, split, config.learn) for split in ("train", "val"))
    task = DetectionTask(train, val, config.training, config.seed, most_certain, config.loss)
    with training_screen(config.training, task.steps_per_epoch, curves=None) as screen:
        steps = task.loss, task.batches, task.steps_per_epoch
        todo = Fit(*steps, task.validate, report=screen.report, watch=screen.watch)
        detector = Detector(config.detector, key=jax.random.key(config.seed))
        return fit(detector, todo, config.training, seed=config.seed, directory=run.directory)


@experiment(Config, finished_by="metrics.json")
def main(config: Config, run: Run) -> None:
    """Train, unless weights are given; test; write weights, and metrics.json last."""
    trackers = csrt_trackers() if config.tracker == "csrt" else None  # before hours of training
    if config.weights is None:
        detector, size = _trained(config, run), config.detector
        save_detector(run.directory / "weights.safetensors", detector, size)
    else:
        detector, size = load_detector(config.weights)
    images = _images(config, size, "test", config.ask)
    answers, shares = ask_detector(detector, images, _sequences(config, "test"), least=config.least, trackers=trackers)
    groups = grouped_figures(answers, seed=config.seed, draws=config.draws)
    results = {
        "test": answer_figures(answers, seed=config.seed, draws=config.draws),
        "groups": groups,
        "images": {"count": len(images.label), **shares},
        "parameters": parameter_count(detector),
        "detector": to_mapping(size),
        "trained": {name: to_mapping(getattr(config, name)) for name in ("learn", "loss", "training")},
        "tracker": config.tracker,
        **run.origin,
    }
    write_json(run.directory / "metrics.json", results)
    console = Console(soft_wrap=True)
    for rig, figures in groups["rigs"].items():
        console.print(f"{rig}: {figures['clips']} sequences, accuracy {figures['accuracy']:.3f}")
    console.print(str(run.directory / "metrics.json"))


if __name__ == "__main__":
    main()
