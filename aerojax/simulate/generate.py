"""A data set's sequences in worker processes: what is missing is made, each whole or not at all; then the manifest."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path

from aerojax.core.errors import UserError
from aerojax.core.files import write_json, write_text
from aerojax.core.workers import run_jobs
from aerojax.data.manifest import ENTRY, write_manifest, write_sequence_entry
from aerojax.simulate.assets.catalogue import Identity, build_identity
from aerojax.simulate.plan.dataset import DatasetConfig, SequenceTask, count, identities_by_split, work_list
from aerojax.simulate.plan.environment import site_of
from aerojax.simulate.plan.planner import plan_sequence
from aerojax.simulate.publish.card import LICENCE_TEXT, readme_text
from aerojax.simulate.publish.croissant import croissant_mapping
from aerojax.simulate.publish.manifest import RIGS, begin_rig, build_manifest, complete, sequence_entry
from aerojax.simulate.record import Timings, record_scene

Progress = Callable[[int, int, str], None]
"""Done, total, and of what: `assets`, then `images`."""

_PARTIAL = ".partial"


@dataclass(frozen=True)
class Shard:
    """This process's share of the sequences: number `index` of `count`."""

    index: int
    count: int


@dataclass(frozen=True)
class GenerationResult:
    """What a run did: sequences made, what workers spent on them, seconds passed, and whether all of the set exists."""

    sequences: int
    timings: Timings
    seconds: float
    complete: bool


@dataclass(frozen=True)
class _Job:
    task: SequenceTask
    config: DatasetConfig
    dataset: Path


@dataclass(frozen=True)
class _Build:
    identity: Identity
    assets: Path


def generate_dataset(
    config: DatasetConfig,
    dataset: Path,
    *,
    workers: int,
    shard: Shard,
    progress: Progress,
    overwrite: bool = False,
) -> GenerationResult:
    """Make what is missing of a data set; whoever finds it complete writes its manifest, card and licence.

    Args:
        config: decides every byte of a sequence.
        dataset: folder; other rigs' sequences in it stay and are listed together with these.
        workers: processes.
        shard: takes every `count`-th sequence from `index` on.
        progress: told of assets and of images as they are there.
        overwrite: make this rig's sequences of this shard again, whatever configuration they were made with.

    Raises:
        UserError: the shard does not exist, or the folder holds this rig with another configuration.
    """
    if not 0 <= shard.index < shard.count:
        raise UserError(
            "missing", f"shard={shard.index} of shards={shard.count} does not exist", f"use 0 to {shard.count - 1}"
        )
    everything = work_list(config)
    mine = everything[shard.index :: shard.count]
    if overwrite:
        _discard(dataset, config, mine)
    begin_rig(dataset, config)
    jobs = [_Job(task, config, dataset) for task in mine if not (dataset / task.folder / ENTRY).is_file()]
    jobs.sort(key=lambda job: site_of(job.task, config))  # workers keep the last site's landscape
    begin, timings = time.perf_counter(), Timings()
    if jobs:
        _build_assets(jobs, config, dataset, workers, progress)
        images = count(config, everything).images // len(everything) * len(jobs)
        timings = _make_all(jobs, images, workers, progress)
    done = complete(dataset, everything)
    if done:
        _publish(dataset, config)
    return GenerationResult(len(jobs), timings, time.perf_counter() - begin, done)


def _discard(dataset: Path, config: DatasetConfig, tasks: tuple[SequenceTask, ...]) -> None:
    (dataset / RIGS / f"{config.rig.name}.json").unlink(missing_ok=True)
    for task in tasks:
        shutil.rmtree(dataset / task.folder, ignore_errors=True)


def _build_assets(jobs: list[_Job], config: DatasetConfig, dataset: Path, workers: int, progress: Progress) -> None:
    everyone = [identity for split in identities_by_split(config).values() for identity in split]
    wanted, splits = {job.task.identity.name for job in jobs}, {job.task.identity.split for job in jobs}
    crowded = splits if config.crowd.most > 1 else set()
    builds = [_Build(i, dataset / "assets") for i in everyone if i.split in crowded or i.name in wanted]
    progress(0, len(builds), "assets")
    for done, _ in enumerate(run_jobs(_build, builds, workers=workers), start=1):
        progress(done, len(builds), "assets")


def _make_all(jobs: list[_Job], images: int, workers: int, progress: Progress) -> Timings:
    total = Timings()
    progress(0, images, "images")
    for spent in run_jobs(_make, jobs, workers=workers):
        for item in fields(Timings):
            setattr(total, item.name, getattr(total, item.name) + getattr(spent, item.name))
        progress(total.images, images, "images")
    progress(total.images, total.images, "images")  # the estimate takes every rig for the largest
    return total


def _build(build: _Build) -> None:
    build_identity(build.identity, build.assets)


def _make(job: _Job) -> Timings:
    """One sequence: written beside its place and renamed when it is complete."""
    folder = job.dataset / job.task.folder
    partial = folder.with_name(folder.name + _PARTIAL)
    shutil.rmtree(partial, ignore_errors=True)
    plan = plan_sequence(job.task, job.config, job.dataset / "assets")
    capture, timings = record_scene(plan, partial)
    write_sequence_entry(sequence_entry(job.task, job.config, plan, capture, job.dataset), job.dataset, partial)
    shutil.rmtree(folder, ignore_errors=True)
    partial.rename(folder)
    return timings


def _publish(dataset: Path, config: DatasetConfig) -> None:
    """Write licence, card and metadata, and `dataset.json` last: where it exists, the data set is complete."""
    manifest = build_manifest(dataset, config)
    write_text(dataset / "LICENSE", LICENCE_TEXT)
    write_text(dataset / "README.md", readme_text(manifest))
    write_json(dataset / "croissant.json", croissant_mapping(manifest, dataset))
    write_manifest(manifest, dataset)
