"""Clips of Gaussians from the sequences of data sets: the work list and what each worker process does."""

from __future__ import annotations

import json
from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import jax
import numpy as np
from rich.console import Console

from aerojax.capture.format import read_capture
from aerojax.core.config import to_mapping
from aerojax.core.errors import UserError
from aerojax.core.workers import run_jobs
from aerojax.pipeline.offline import PipelineConfig, reconstruct_capture
from aerojax.simulate.plan.single import sequence_seed
from aerojax.training.variation import save_clip
from experiments._launch.command import write_json
from experiments._launch.progress import progress_bar

MANIFEST = "manifest.json"


@dataclass(frozen=True)
class ClipsConfig:
    """What decides the clips of a data set.

    seed: of the decimation. tokens: kept of each frame's Gaussians.
    """

    seed: int
    tokens: int
    pipeline: PipelineConfig


@dataclass(frozen=True)
class _Job:
    capture: Path
    label: str
    identity: str
    config: ClipsConfig
    path: Path


def make_clips(
    config: ClipsConfig, datasets: tuple[Path, ...], folder: Path, *, only: tuple[str, ...], workers: int
) -> dict[str, int]:
    """Reconstruct every sequence that has no clip yet: `<folder>/<rig>/<split>/<sequence>.npz`.

    `only` are patterns of sequence names, such as `sim1_*_r016_*`.

    A clip exists whole or not at all, and depends on its sequence and the seed alone, so a killed run goes on where it
    stopped and the number of workers changes nothing.

    Returns:
        How many clips there are by `rig/split`.

    Raises:
        UserError: a data set is not complete, or the folder holds clips of another configuration.
    """
    everything = [job for dataset in datasets for job in _jobs(config, dataset, folder)]
    jobs = [job for job in everything if any(fnmatch(job.path.stem, pattern) for pattern in only)]
    if not jobs:
        raise UserError(
            "out-of-range",
            f"only={list(only)} matches none of {len(everything)} sequences",
            "their names are in dataset.json",
        )
    _claim(folder, config)
    missing = [job for job in jobs if not job.path.exists()]
    failures = 0
    with progress_bar("clips/s") as bar:
        task = bar.add_task(f"clips in {folder}", total=len(missing))
        for reason in run_jobs(_make_clip, missing, workers=workers):
            failures += reason is not None
            bar.advance(task)
    if failures:
        Console(stderr=True).print(
            f"{failures} of {len(missing)} sequences left no clip: never seen whole by enough cameras"
        )
    places = sorted({str(job.path.parent.relative_to(folder)) for job in jobs})
    return {place: len(list((folder / place).glob("*.npz"))) for place in places}


def _jobs(config: ClipsConfig, dataset: Path, folder: Path) -> list[_Job]:
    path = dataset / "dataset.json"
    if not path.is_file():
        raise UserError("missing", f"{path} does not exist", "generate the data set first, or let its generation end")
    return [
        _Job(
            dataset / entry["folder"],
            entry["class"],
            entry["identity"],
            config,
            folder / entry["rig"] / entry["split"] / f"{entry['name']}.npz",
        )
        for entry in json.loads(path.read_text())["sequences"]
    ]


def _claim(folder: Path, config: ClipsConfig) -> None:
    """Note the configuration in the folder, or find it to be the one that is there."""
    plain = json.loads(json.dumps(to_mapping(config), default=str))
    path = folder / MANIFEST
    if path.is_file() and json.loads(path.read_text()) != plain:
        raise UserError("occupied", f"{path}: the folder holds clips of another configuration", "choose another folder")
    folder.mkdir(parents=True, exist_ok=True)
    write_json(path, plain)


def pipeline_of(folder: Path) -> Any:
    """How the clips of a folder were reconstructed, for the notes in a model's weights; None where it is not known."""
    for place in (folder.parent, folder):
        if (place / MANIFEST).is_file():
            return json.loads((place / MANIFEST).read_text()).get("pipeline")
    return None


def _make_clip(job: _Job) -> str | None:
    """Reconstruct the first object of a sequence and save its clip; the reason instead where no frame was usable."""
    seed = sequence_seed(job.config.seed, job.path.stem)
    try:
        capture = read_capture(job.capture)
        clip = reconstruct_capture(capture, job.config.pipeline, key=jax.random.key(seed % 2**31), object_id=1)
    except UserError as error:
        if not any(words in str(error) for words in ("frames could be used", "appears in no mask")):
            raise
        return str(error)
    columns = np.asarray(clip.gaussians.columns())[:, : job.config.tokens]
    save_clip(job.path, columns, job.label, job.identity)
    return None
