"""Measure masks that are found without masks against the captures' own: overlap, ghosts, and how many must agree."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from aerojax.capture.format import read_capture
from aerojax.classify.load import load_classifier
from aerojax.core.config import to_mapping
from aerojax.core.errors import UserError
from aerojax.core.files import write_json
from aerojax.evaluate.clutter import ClutterConfig
from aerojax.evaluate.segmentation import segmentation_table
from aerojax.pipeline.config import PipelineConfig
from aerojax.segment.voxel_vote.member import VoxelVoteConfig
from experiments._launch.command import Run, experiment
from experiments._launch.progress import progress_bar, shown_in
from experiments._segmentation.labels import label_figures
from experiments._segmentation.measured import Classifying, Shown, measured, some_cameras

Row = dict[str, Any]
"""Of one capture with so many cameras, of which so many must agree: JSON-ready figures."""


@dataclass(frozen=True, kw_only=True)
class Config:
    """Which captures, and what is in their way.

    captures: folders of captures with masks, or folders that hold such folders.
    only: patterns of the names of captures that are taken.
    spread: so many of each pattern, evenly; 0 takes all.
    cameras: of each capture, so many, spread evenly; 0 takes all.
    views: cameras that must agree; 0 takes the member's rule.
    most_frames: of a capture, from its first; 0 takes all.
    clutter: put behind the objects; None leaves the images as they are.
    segment: the member.
    labels: whether objects are classified, by the masks that are found and by those of the capture.
    pipeline: behind the masks. weights: of a causal classifier; the shipped ones if None.
    seed: of the clutter and the decimation.
    """

    preset: str
    captures: tuple[Path, ...]
    only: tuple[str, ...] = ("*",)
    spread: int = 0
    cameras: tuple[int, ...] = (0,)
    views: tuple[int, ...] = (0,)
    most_frames: int = 0
    clutter: ClutterConfig | None = None
    segment: VoxelVoteConfig = field(default_factory=VoxelVoteConfig)
    labels: bool = False
    pipeline: PipelineConfig = field(default_factory=PipelineConfig)
    weights: Path | None = None
    seed: int = 0


def _folders(config: Config) -> list[Path]:
    found = [
        path.parent if path.is_file() else path
        for folder in config.captures
        for path in ([folder] if (folder / "capture.json").is_file() else sorted(folder.glob("*/capture.json")))
    ]
    chosen = []
    for pattern in config.only:
        named = [path for path in found if fnmatch(path.name, pattern)]
        places = np.linspace(0, len(named), config.spread or len(named), endpoint=False).astype(int)
        chosen += [named[place] for place in np.unique(places)]
    if not chosen:
        asked = f"captures={list(map(str, config.captures))} only={list(config.only)}"
        raise UserError("missing", f"{asked}: no capture there", "name folders of captures")
    return chosen


def _rows(config: Config, kept: Path, progress: Callable[[int, int, str], None]) -> list[Row]:
    """A row a case, each written to `kept` as it is there; those that a stopped run left are taken from it."""
    cases = [(path, n, k) for path in _folders(config) for n in config.cameras for k in config.views]
    rows: list[Row] = json.loads(kept.read_text(encoding="utf-8")) if kept.is_file() else []
    classifying = Classifying(config.pipeline, load_classifier(config.weights)) if config.labels else None
    for done, (path, cameras, views) in enumerate(cases[len(rows) :], len(rows)):
        progress(done, len(cases), "captures")
        capture = some_cameras(read_capture(path), cameras, config.most_frames)
        shown = Shown.of(capture, config.clutter, config.seed)
        segment = replace(config.segment, vote=replace(config.segment.vote, views=views))
        row = {"capture": path.name, "cameras": len(capture.cameras), "views": views}
        rows.append({**row, **measured(shown, segment, classifying, seed=config.seed)})
        write_json(kept, rows)
    progress(len(cases), len(cases), "captures")
    return rows


@experiment(Config, finished_by="results.json")
def main(config: Config, run: Run) -> None:
    """Write results.json and print a row a capture; one that was stopped goes on where it was."""
    console = Console()
    with progress_bar() as bar:
        rows = _rows(config, run.directory / "rows.json", shown_in(bar))
    console.print(segmentation_table(rows), soft_wrap=True)
    notes = {"rows": rows, "segment": to_mapping(config.segment), "seed": config.seed}
    notes |= {"clutter": None if config.clutter is None else to_mapping(config.clutter)}
    if config.labels:
        notes |= {"labels": label_figures(rows), "pipeline": to_mapping(config.pipeline)}
        console.print(str(notes["labels"]), markup=False)
    write_json(run.directory / "results.json", {**notes, **run.origin})
    console.print(str(run.directory / "results.json"), soft_wrap=True)


if __name__ == "__main__":
    main()
