"""Measure masks that are found without masks against the captures' own: overlap, ghosts, and how many must agree."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from rich.console import Console

from aerojax.capture.format import Capture, read_capture
from aerojax.core.config import to_mapping
from aerojax.core.errors import UserError
from aerojax.core.files import write_json
from aerojax.core.provenance import provenance
from aerojax.core.seeds import seed_of
from aerojax.core.types import FrameSet
from aerojax.evaluate.clutter import Clutter, ClutterConfig, cluttered
from aerojax.evaluate.segmentation import frame_score, segmentation_figures, segmentation_table
from aerojax.pipeline.source import capture_preview
from aerojax.segment.voxel_vote.member import VoxelVoteConfig
from experiments._launch.command import Run, experiment
from experiments._launch.progress import progress_bar


@dataclass(frozen=True, kw_only=True)
class Config:
    """Which captures, and what is in their way.

    captures: folders of captures with masks, or folders that hold such folders.
    cameras: of each capture, so many, spread evenly; 0 takes all.
    views: cameras that must agree; 0 takes the member's rule.
    most_frames: of a capture, from its first; 0 takes all.
    clutter: put behind the objects; None leaves the images as they are.
    segment: the member.
    seed: of the clutter.
    """

    preset: str
    captures: tuple[Path, ...]
    cameras: tuple[int, ...] = (0,)
    views: tuple[int, ...] = (0,)
    most_frames: int = 0
    clutter: ClutterConfig | None = None
    segment: VoxelVoteConfig = field(default_factory=VoxelVoteConfig)
    seed: int = 0


def _folders(config: Config) -> list[Path]:
    found = [
        path.parent if path.is_file() else path
        for folder in config.captures
        for path in ([folder] if (folder / "capture.json").is_file() else sorted(folder.glob("*/capture.json")))
    ]
    if not found:
        raise UserError(
            "missing", f"captures={list(map(str, config.captures))}: no capture there", "name folders of captures"
        )
    return found


def _measure(capture: Capture, views: int, config: Config) -> dict[str, Any]:
    """Figures of one capture."""
    known = [
        Clutter(c.width, c.height, seed=seed_of(config.seed, c.name), config=config.clutter)
        for c in capture.cameras
        if config.clutter is not None
    ]

    def shown(frames: FrameSet) -> FrameSet:
        return cluttered(frames, known) if known else frames

    def preview(count: int, *, rgb: bool, ids: bool) -> Iterator[FrameSet]:
        return (shown(frames) for frames in capture_preview(capture)(count, rgb=rgb, ids=ids or bool(known)))

    segmenter = replace(config.segment, vote=replace(config.segment.vote, views=views)).build(None)
    state, scores, seconds = segmenter.initial(capture.cameras, preview), [], []
    for frames in capture_preview(capture)(capture.frames, rgb=True, ids=True):
        frames = shown(frames)
        start = perf_counter()
        found, state = segmenter.step(frames, state)
        seconds.append(perf_counter() - start)
        scores.append(frame_score(frames, found))
    return {**segmentation_figures(scores), "step_ms": 1000 * float(np.median(seconds))}


def _some(capture: Capture, cameras: int, frames: int) -> Capture:
    chosen = np.unique(
        np.linspace(0, len(capture.cameras), cameras or len(capture.cameras), endpoint=False).astype(int)
    )
    kept = tuple(capture.cameras[index] for index in chosen)
    return replace(capture, cameras=kept, frames=min(frames or capture.frames, capture.frames))


@experiment(Config, finished_by="results.json")
def main(config: Config, run: Run) -> None:
    """Write results.json and print a row a capture."""
    cases = [(path, n, k) for path in _folders(config) for n in config.cameras for k in config.views]
    console, rows = Console(), []
    with progress_bar() as bar:
        for path, cameras, views in bar.track(cases, description="captures"):
            capture = _some(read_capture(path), cameras, config.most_frames)
            row = {"capture": path.name, "cameras": len(capture.cameras), "views": views}
            rows.append({**row, **_measure(capture, views, config)})
    console.print(segmentation_table(rows), soft_wrap=True)
    notes = {"rows": rows, "segment": to_mapping(config.segment), "command": run.command, "seed": config.seed}
    notes |= {"clutter": None if config.clutter is None else to_mapping(config.clutter)}
    write_json(run.directory / "results.json", {**notes, **provenance(run.overrides)})
    console.print(str(run.directory / "results.json"), soft_wrap=True)


if __name__ == "__main__":
    main()
