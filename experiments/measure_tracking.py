"""Measure tracks of several objects: from detections alone, with wrong clocks and poses, and from masks with labels."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from rich.console import Console

from aerojax.capture.format import Capture, read_capture
from aerojax.classify.familiarity import load_familiarity
from aerojax.classify.load import load_classifier
from aerojax.core.config import to_mapping
from aerojax.core.files import write_json
from aerojax.pipeline.config import PipelineConfig
from aerojax.pipeline.trust import TrustConfig
from aerojax.simulate.generate import Shard, generate_dataset
from aerojax.simulate.plan.dataset import DatasetConfig, work_list
from experiments._launch.command import Run, experiment
from experiments._launch.progress import progress_bar, shown_in
from experiments._tracking import detections, recorded
from experiments._tracking.detections import MeasuredConfig, Row
from experiments._tracking.flown import FlownConfig, fly
from experiments._tracking.recorded import Asked
from experiments._tracking.summary import summary, table

Kind = Literal["tracks", "stagger", "clocks", "poses", "masks", "masks_poses"]


@dataclass(frozen=True, kw_only=True)
class Config:
    """Scenes, and what is measured of them.

    only: kinds of rows: detections of synchronised cameras (tracks), of others (stagger), with wrong clocks or a wrong
        pose, and masks of captures, also with a wrong pose.
    scenes: of detections, a row each. captures: of those that are simulated; 0 takes all.
    wrong: of them with a wrong pose, from the first.
    flown: the scenes of detections. dataset: the captures. folder: of them.
    measured: how detections are followed, and what is wrong with cameras.
    weights: of a causal classifier; the shipped ones if None. pipeline: of the captures. trust: in an answer.
    """

    preset: str
    seed: int = 0
    only: tuple[Kind, ...] = ("tracks", "stagger", "clocks", "poses", "masks", "masks_poses")
    scenes: int = 20
    captures: int = 0
    wrong: int = 6
    flown: FlownConfig
    dataset: DatasetConfig
    folder: Path = Path("data/tracking")
    measured: MeasuredConfig = field(default_factory=MeasuredConfig)
    weights: Path | None = None
    pipeline: PipelineConfig = field(default_factory=PipelineConfig)
    trust: TrustConfig = field(default_factory=TrustConfig)


def _captures(config: Config, progress: Callable[[int, int, str], None]) -> list[Capture]:
    """The captures, spread over the data set's sequences; they are simulated if they are not there."""
    generate_dataset(config.dataset, config.folder, workers=1, shard=Shard(0, 1), progress=progress)
    tasks = work_list(config.dataset)
    chosen = np.unique(np.linspace(0, len(tasks), config.captures or len(tasks), endpoint=False).astype(int))
    return [read_capture(config.folder / tasks[index].folder) for index in chosen.tolist()]


def _rows(config: Config, progress: Callable[[int, int, str], None]) -> Iterable[tuple[Kind, Row]]:
    """Rows in the order of their kinds, each as it is there."""
    ways: dict[Kind, Callable[..., Row]] = {
        "tracks": lambda scene, number: detections.tracks_row(scene, config.flown, config.measured, stagger=False),
        "stagger": lambda scene, number: detections.tracks_row(scene, config.flown, config.measured, stagger=True),
        "clocks": lambda scene, number: detections.clocks_row(scene, config.flown, config.measured),
        "poses": lambda scene, number: detections.poses_row(scene, config.flown, config.measured, number),
    }
    for kind in (kind for kind in ways if kind in config.only):
        for number in range(config.scenes):
            progress(number, config.scenes, kind)
            yield kind, ways[kind](fly(config.flown, config.seed, number), number)
        progress(config.scenes, config.scenes, kind)
    if not {"masks", "masks_poses"} & set(config.only):
        return
    captures = _captures(config, progress)
    known = load_classifier(config.weights), load_familiarity(config.weights)
    asked = Asked(config.pipeline, *known, config.trust, config.seed)
    for number, capture in enumerate(captures if "masks" in config.only else ()):
        progress(number, len(captures), "masks")
        yield "masks", recorded.tracks_row(capture, asked)
    for number, capture in enumerate(captures[: config.wrong] if "masks_poses" in config.only else ()):
        progress(number, config.wrong, "masks_poses")
        yield "masks_poses", recorded.poses_row(capture, number, asked, config.measured)


@experiment(Config, finished_by="results.json")
def main(config: Config, run: Run) -> None:
    """Write results.json and print the worst and the middle of every figure."""
    console, rows = Console(), dict[str, list[Row]]()
    with progress_bar() as bar:
        for kind, row in _rows(config, shown_in(bar)):
            rows.setdefault(kind, []).append(row)
    notes: dict[str, Any] = {"seed": config.seed}
    notes |= {name: to_mapping(getattr(config, name)) for name in ("flown", "dataset", "measured", "pipeline")}
    found = summary(rows)
    write_json(run.directory / "results.json", {"summary": found, "rows": rows, **notes, **run.origin})
    console.print(table(found), soft_wrap=True)
    for kind in (kind for kind in found if "answers" in found[kind]):
        console.print(f"{kind}: {found[kind]['answers']}", soft_wrap=True)
    console.print(str(run.directory / "results.json"), soft_wrap=True)


if __name__ == "__main__":
    main()
