"""A data set's sequences in worker processes: what is missing is made, each whole or not at all; then the manifest."""

from __future__ import annotations

import shutil
import time
from dataclasses import dataclass, fields
from pathlib import Path

from aerojax.core.errors import UserError
from aerojax.core.workers import run_jobs
from aerojax.simulate.assets.catalogue import Identity, build_identity
from aerojax.simulate.plan.dataset import CampaignConfig, SequenceTask, cast_of, count, work_list
from aerojax.simulate.plan.sequence import draw_scene, site_of
from aerojax.simulate.publish.card import LICENCE_TEXT, readme_text
from aerojax.simulate.publish.croissant import croissant_mapping
from aerojax.simulate.publish.manifest import (
    ENTRY,
    begin_rig,
    build_manifest,
    complete,
    sequence_entry,
    write_json,
    write_text,
)
from aerojax.simulate.record import Costs, record_scene
from experiments._launch.command import provenance
from experiments._launch.progress import progress_bar

PARTIAL = ".partial"


@dataclass(frozen=True)
class Shard:
    """This process's share of the sequences: number `index` of `count`."""

    index: int
    count: int


@dataclass(frozen=True)
class Made:
    """What a run did: sequences made, what workers spent on them, seconds passed, and whether all of the set exists."""

    sequences: int
    costs: Costs
    seconds: float
    complete: bool


@dataclass(frozen=True)
class _Job:
    task: SequenceTask
    config: CampaignConfig
    dataset: Path


@dataclass(frozen=True)
class _Build:
    identity: Identity
    assets: Path


def make_dataset(config: CampaignConfig, dataset: Path, *, workers: int, shard: Shard, overwrite: bool = False) -> Made:
    """Make what is missing of a data set; whoever finds it complete writes its manifest, card and licence.

    Args:
        config: decides every byte of a sequence.
        dataset: folder; other rigs' sequences in it stay and are listed together with these.
        workers: processes.
        shard: takes every `count`-th sequence from `index` on.
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
    origin = provenance()
    begin_rig(dataset, config, {"versions": origin["versions"], "commit": origin["commit"]})
    jobs = [_Job(task, config, dataset) for task in mine if not (dataset / task.folder / ENTRY).is_file()]
    jobs.sort(key=lambda job: site_of(job.task, config))  # workers keep the last site's landscape
    begin, costs = time.perf_counter(), Costs()
    if jobs:
        _build_assets(jobs, config, dataset, workers)
        _make_all(jobs, count(config, everything).images // len(everything), costs, workers)
    done = complete(dataset, everything)
    if done:
        write_manifest(dataset, config)
    return Made(len(jobs), costs, time.perf_counter() - begin, done)


def _discard(dataset: Path, config: CampaignConfig, tasks: tuple[SequenceTask, ...]) -> None:
    (dataset / "rigs" / f"{config.rig.name}.json").unlink(missing_ok=True)
    for task in tasks:
        shutil.rmtree(dataset / task.folder, ignore_errors=True)


def _build_assets(jobs: list[_Job], config: CampaignConfig, dataset: Path, workers: int) -> None:
    crowded = config.crowd.objects > 1 or config.crowd.birds > 0
    everyone = [identity for cast in cast_of(config).values() for identity in cast]
    wanted = {job.task.identity.name for job in jobs}
    builds = [_Build(i, dataset / "assets") for i in everyone if crowded or i.name in wanted]
    with progress_bar() as bar:
        task = bar.add_task("assets", total=len(builds))
        for _ in run_jobs(_build, builds, workers=workers):
            bar.advance(task)


def _make_all(jobs: list[_Job], images: int, costs: Costs, workers: int) -> None:
    with progress_bar("images/s") as bar:
        task = bar.add_task("images", total=images * len(jobs))
        for spent in run_jobs(_make, jobs, workers=workers):
            for item in fields(Costs):
                setattr(costs, item.name, getattr(costs, item.name) + getattr(spent, item.name))
            bar.advance(task, spent.images)


def _build(build: _Build) -> None:
    build_identity(build.identity, build.assets)


def _make(job: _Job) -> Costs:
    """One sequence: written beside its place and renamed when it is complete."""
    folder = job.dataset / job.task.folder
    partial = folder.with_name(folder.name + PARTIAL)
    shutil.rmtree(partial, ignore_errors=True)
    plan = draw_scene(job.task, job.config, job.dataset / "assets")
    capture, costs = record_scene(plan, partial)
    write_json(partial / ENTRY, sequence_entry(job.task, job.config, plan, capture))
    shutil.rmtree(folder, ignore_errors=True)
    partial.rename(folder)
    return costs


def write_manifest(dataset: Path, config: CampaignConfig) -> None:
    """Write licence, card and metadata, and `dataset.json` last: where it exists, the data set is complete."""
    manifest = build_manifest(dataset, config)
    write_text(dataset / "LICENSE", LICENCE_TEXT)
    write_text(dataset / "README.md", readme_text(manifest))
    write_json(dataset / "croissant.json", croissant_mapping(manifest))
    write_json(dataset / "dataset.json", manifest)
