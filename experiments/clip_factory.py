"""Clips of Gaussians from simulated sequences: the work list, the worker processes and what each of them does."""

from __future__ import annotations

import hashlib
import json
import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path

import jax
import numpy as np
from rich.console import Console

from aerojax.capture.format import read_capture
from aerojax.config import to_mapping
from aerojax.errors import UserError
from aerojax.pipeline import PipelineConfig, reconstruct_capture
from aerojax.simulate.assets.catalogue import Identity, build_identity, identities
from aerojax.simulate.dataset import SequenceConfig, sequence_seed, simulate_sequence
from aerojax.training.data import save_clip
from experiments.launch import write_json
from experiments.progress import progress_bar
from experiments.worker_pool import run_jobs


@dataclass(frozen=True)
class SplitSize:
    """Identities a class, and sequences an identity."""

    identities: int
    sequences: int


@dataclass(frozen=True)
class ClipsConfig:
    """What decides a set of clips, and hence the name of its folder."""

    seed: int
    splits: dict[str, SplitSize]
    tokens: int
    sequence: SequenceConfig
    pipeline: PipelineConfig


@dataclass(frozen=True)
class _Job:
    identity: Identity
    name: str
    config: ClipsConfig
    assets: Path
    path: Path


def ensure_clips(config: ClipsConfig, *, folder: Path, assets: Path, workers: int) -> Path:
    """Make what is missing of a set of clips and return its folder (`train/`, `val/`, `test/` inside).

    A clip exists whole or not at all, and depends on its name and the seed alone, so a killed run goes on where it
    stopped and the number of workers changes nothing.
    """
    plain = to_mapping(ClipsConfig(config.seed, config.splits, config.tokens, config.sequence, config.pipeline))
    digest = hashlib.blake2b(json.dumps(plain, sort_keys=True, default=str).encode(), digest_size=6).hexdigest()
    target = folder / digest
    target.mkdir(parents=True, exist_ok=True)
    write_json(target / "manifest.json", json.loads(json.dumps(plain, default=str)))
    jobs = [job for job in _jobs(config, target, assets) if not job.path.exists()]
    if not jobs:
        return target
    for identity in {job.identity for job in jobs}:
        build_identity(identity, assets)
    with progress_bar() as bar:
        task = bar.add_task(f"clips in {target}", total=len(jobs))
        failures = 0
        for reason in run_jobs(_make_clip, jobs, workers=workers):
            failures += reason is not None
            bar.advance(task)
    if failures:
        Console(stderr=True).print(f"{failures} of {len(jobs)} sequences left no clip: the object was never seen whole")
    return target


def _jobs(config: ClipsConfig, target: Path, assets: Path) -> list[_Job]:
    jobs = []
    for split, size in config.splits.items():
        for identity in identities(split, size.identities):
            for index in range(size.sequences):
                name = f"{identity.label}_{identity.name}_{index:03d}"
                jobs.append(_Job(identity, name, config, assets, target / split / f"{name}.npz"))
    return jobs


def _make_clip(job: _Job) -> str | None:
    """Simulate, reconstruct and save one clip; the reason instead where no frame was usable."""
    seed = sequence_seed(job.config.seed, job.name)
    scratch = Path(tempfile.mkdtemp(prefix="aerojax_"))
    try:
        folder = scratch / job.name
        simulate_sequence(job.identity, job.config.sequence, seed=seed, folder=folder, assets=job.assets)
        clip = reconstruct_capture(read_capture(folder), job.config.pipeline, key=jax.random.key(seed % 2**31))
    except UserError as error:
        if "frames could be used" not in str(error):
            raise
        return str(error)
    finally:
        shutil.rmtree(scratch, ignore_errors=True)
    columns = np.asarray(clip.gaussians.columns())[:, : job.config.tokens]
    save_clip(job.path, columns, job.identity.label, job.identity.name)
    return None
