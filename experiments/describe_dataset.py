"""Describe data sets: composition, consistency of the annotations, coverage, motion, and leakage between splits."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from aerojax.core.errors import UserError
from aerojax.core.files import write_json
from aerojax.core.workers import run_jobs
from aerojax.data.manifest import DatasetEntries, SequenceEntry, read_datasets
from aerojax.evaluate.dataset_qa.description import Description, describe, to_json
from aerojax.evaluate.dataset_qa.observations import Observations, joined, observe_sequence
from aerojax.evaluate.dataset_qa.shape_jobs import ShapeJob, ShapeResult, describe_shape
from aerojax.view.dataset.figures import sections_of
from aerojax.view.dataset.page import dataset_page
from aerojax.view.dataset.plots import standalone
from aerojax.view.dataset.summary import summary, tables_of
from aerojax.view.dataset.tables import markdown
from experiments._launch.command import Run, experiment
from experiments._launch.progress import progress_bar

TITLE = "Data set"


@dataclass(frozen=True, kw_only=True)
class Config:
    """What to describe.

    dataset: folders of generated data sets.
    every: read only every so many-th sequence's images, over the whole list; the composition is of all.
    depth: read depth images too, which separates perspective from other residuals.
    motion_frames, motion_fps, motion_points: how the identities' animations are sampled.
    workers: processes.
    """

    preset: str
    dataset: tuple[Path, ...]
    every: int = 1
    depth: bool = True
    motion_frames: int = 30
    motion_fps: float = 30.0
    motion_points: int = 512
    workers: int = 2


@dataclass(frozen=True)
class _Job:
    entry: SequenceEntry
    index: int
    depth: bool


@experiment(Config)
def main(config: Config, run: Run) -> None:
    """Read the data sets and write description.json, description.md, description.html and figures/."""
    if config.every < 1:
        raise UserError("out-of-range", f"every is {config.every}", "use 1 to read all sequences")
    entries = read_datasets(config.dataset)
    shapes = _shapes(entries, config)
    observations = _observations(entries, config)
    found = describe(entries, observations, [s.embedded for s in shapes], [s.motion for s in shapes])
    write_description(found, run.directory)
    Console().print(summary(found), highlight=False, soft_wrap=True)
    Console().print(str(run.directory / "description.html"), soft_wrap=True)


def _shapes(entries: DatasetEntries, config: Config) -> list[ShapeResult]:
    several = {identity.name: identity for identity in entries.identities}.values()
    jobs = [ShapeJob(item, config.motion_frames, config.motion_fps, config.motion_points) for item in several]
    with progress_bar() as bar:
        found = list(bar.track(run_jobs(describe_shape, jobs, workers=config.workers), len(jobs), description="shapes"))
    return sorted(found, key=lambda result: result.embedded.entry.name)


def _observe(job: _Job) -> Observations:
    return observe_sequence(job.entry, job.index, depth=job.depth)


def _observations(entries: DatasetEntries, config: Config) -> Observations:
    jobs = [_Job(entry, i, config.depth) for i, entry in enumerate(entries.sequences)][:: config.every]
    with progress_bar() as bar:
        parts = list(bar.track(run_jobs(_observe, jobs, workers=config.workers), len(jobs), description="sequences"))
    return joined(sorted(parts, key=lambda part: int(part.sequence[0])))


def write_description(found: Description, folder: Path) -> None:
    """Write all files; pictures go to `figures/`."""
    tables, sections = tables_of(found), sections_of(found)
    title = f"{TITLE} {', '.join(found.folders)}"
    write_json(folder / "description.json", to_json(found))
    (folder / "description.md").write_text(markdown(tables, title=title), encoding="utf-8")
    (folder / "description.html").write_text(dataset_page(title, summary(found), tables, sections), encoding="utf-8")
    (folder / "figures").mkdir(exist_ok=True)
    for figure in (figure for section in sections for figure in section.figures):
        path = folder / "figures" / f"{figure.file}.{'png' if isinstance(figure.picture, bytes) else 'svg'}"
        path.write_bytes(figure.picture if isinstance(figure.picture, bytes) else standalone(figure.picture).encode())


if __name__ == "__main__":
    main()
