"""Descriptions of data sets from their files: every identity's shape and every sequence's images, by processes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from aerojax.core.errors import UserError
from aerojax.core.workers import run_jobs
from aerojax.data.manifest import DatasetEntries, SequenceEntry, read_datasets
from aerojax.evaluate.dataset_qa.description import Description, describe
from aerojax.evaluate.dataset_qa.observations import Observations, joined, observe_sequence
from aerojax.evaluate.dataset_qa.shape_jobs import ShapeJob, ShapeResult, describe_shape

Progress = Callable[[int, int, str], None]
_Result = TypeVar("_Result")


@dataclass(frozen=True, kw_only=True)
class SurveyConfig:
    """How much of data sets is read.

    every: read only every so many-th sequence's images, over the whole list; the composition is of all.
    depth: read depth images too, which separates perspective from other residuals.
    motion_frames, motion_fps, motion_points: how the identities' animations are sampled.
    workers: processes.
    """

    every: int = 1
    depth: bool = True
    motion_frames: int = 30
    motion_fps: float = 30.0
    motion_points: int = 512
    workers: int = 2


@dataclass(frozen=True)
class _SequenceJob:
    entry: SequenceEntry
    index: int
    depth: bool


def survey_datasets(folders: Sequence[Path], config: SurveyConfig, progress: Progress) -> Description:
    """Read the data sets and say what is in them.

    Args:
        folders: of generated data sets.
        config: how much is read.
        progress: called with how many of how many are done, of "shapes" and then of "sequences".

    Raises:
        UserError: `every` is below 1, or a file is missing or broken.
    """
    if config.every < 1:
        raise UserError("out-of-range", f"every is {config.every}", "use 1 to read all sequences")
    entries = read_datasets(tuple(folders))
    shapes = _shapes(entries, config, progress)
    observations = _observations(entries, config, progress)
    return describe(entries, observations, [s.embedded for s in shapes], [s.motion for s in shapes])


def _shapes(entries: DatasetEntries, config: SurveyConfig, progress: Progress) -> list[ShapeResult]:
    several = {identity.name: identity for identity in entries.identities}.values()
    jobs = [ShapeJob(item, config.motion_frames, config.motion_fps, config.motion_points) for item in several]
    found = _counted(run_jobs(describe_shape, jobs, workers=config.workers), len(jobs), "shapes", progress)
    return sorted(found, key=lambda result: result.embedded.entry.name)


def _observations(entries: DatasetEntries, config: SurveyConfig, progress: Progress) -> Observations:
    jobs = [_SequenceJob(entry, i, config.depth) for i, entry in enumerate(entries.sequences)][:: config.every]
    parts = _counted(run_jobs(_observe, jobs, workers=config.workers), len(jobs), "sequences", progress)
    return joined(sorted(parts, key=lambda part: int(part.sequence[0])))


def _observe(job: _SequenceJob) -> Observations:
    return observe_sequence(job.entry, job.index, depth=job.depth)


def _counted(results: Iterable[_Result], total: int, what: str, progress: Progress) -> list[_Result]:
    found = []
    for result in results:
        found.append(result)
        progress(len(found), total, what)
    return found
