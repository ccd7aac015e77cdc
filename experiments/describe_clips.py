"""Describe clips: how many Gaussians, how large, turned, opaque and coloured, and how shapes move, by distance."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from rich.console import Console
from rich.table import Table

from aerojax.core.errors import UserError
from aerojax.core.files import write_json
from aerojax.core.workers import run_in_order
from aerojax.data.clips import clip_files, load_clip
from aerojax.data.splits import Split
from aerojax.evaluate.dataset_qa.clip_statistics import (
    ClipStatistics,
    ClipStatisticsConfig,
    clip_statistics,
    summary_of,
)
from experiments._launch.command import Run, experiment
from experiments._launch.progress import progress_bar


@dataclass(frozen=True, kw_only=True)
class Config:
    """Which clips, and how they are described.

    clips: folders of clips, one a rig. split: of them. statistics: what is measured. workers: processes.
    """

    preset: str
    clips: tuple[Path, ...]
    split: Split = "train"
    statistics: ClipStatisticsConfig = field(default_factory=ClipStatisticsConfig)
    workers: int = 2


def _described(path: Path, points: int) -> ClipStatistics | None:
    """Of a clip of one frame there is nothing to compare."""
    clip = load_clip(path)
    return clip_statistics(clip, points) if len(clip.columns) > 1 else None


@experiment(Config, finished_by="results.json")
def main(config: Config, run: Run) -> None:
    """Write results.json and print how shapes move, by class and by the pixels that an object spans."""
    paths = [path for folder in config.clips for path in clip_files(folder / config.split)[:: config.statistics.every]]
    if not paths:
        raise UserError("missing", f"no clips in {', '.join(map(str, config.clips))}", "make them with generate_clips")
    with progress_bar() as bar:
        jobs = run_in_order(partial(_described, points=config.statistics.points), paths, workers=config.workers)
        found = list(bar.track(jobs, total=len(paths), description="clips"))
    described = summary_of([clip for clip in found if clip is not None], config.statistics)
    table = Table("class", "pixels", "clips", "amplitude, radii", "strongest bin", "returns, %")
    for row in described["by_width"]:
        ends = f"{row['from']:g}…{row['to']:g}"
        figures = f"{row['amplitude']:.3f}", str(row["strongest_bin"]), f"{100 * row['periodic']:.0f}"
        table.add_row(row["class"], ends, str(row["clips"]), *figures)
    Console().print(table)
    write_json(run.directory / "results.json", {**described, "split": config.split, **run.origin})
    Console().print(str(run.directory / "results.json"), soft_wrap=True)


if __name__ == "__main__":
    main()
