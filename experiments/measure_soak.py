"""Run the pipeline over a stream without end: time, memory and handles must stay as they are, and the answer too."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import jax
import numpy as np
from rich.console import Console
from rich.table import Table

from aerojax.capture.format import read_capture
from aerojax.capture.frames import read_frames
from aerojax.classify.base import Trainable, with_card
from aerojax.classify.load import load_classifier
from aerojax.core.config import to_mapping
from aerojax.core.errors import UserError
from aerojax.core.files import write_json
from aerojax.pipeline.config import PipelineConfig, clip_settings
from aerojax.pipeline.soak import Soaked, soak
from aerojax.pipeline.step import make_pipeline
from aerojax.simulate.sample import SampleConfig, sample_capture
from experiments._launch.command import Run, experiment
from experiments._launch.progress import progress_bar, shown_in


@dataclass(frozen=True, kw_only=True)
class Config:
    """What flows, and how long.

    frames: steps. windows: into which they are divided.
    settled: passes of the loop before the one that later answers are compared with.
    capture: that is looped; a simulated one if None. assets, sample: of that one.
    weights: of a causal classifier; the shipped ones if None.
    pipeline: its settings; other ones than the weights were trained with are taken too, since the answer need not be
        right here but the same.
    """

    preset: str
    seed: int = 0
    frames: int = 100_000
    windows: int = 50
    settled: int = 1000
    capture: Path | None = None
    assets: Path = Path("data/assets")
    sample: SampleConfig = field(default_factory=SampleConfig)
    weights: Path | None = None
    pipeline: PipelineConfig = field(default_factory=PipelineConfig)


def _classifier(config: Config) -> Trainable:
    loaded = load_classifier(config.weights)
    if not loaded.causal:
        raise UserError("mismatch", f"{loaded.card.name} waits for the end of a clip", "name weights that do not")
    return with_card(loaded, settings=tuple(sorted(clip_settings(config.pipeline).items())))


def _slope(values: list[float], frames: list[int]) -> float:
    """Of the second half, a 10,000 frames: the first one warms up."""
    half = len(values) // 2
    line = np.polyfit(frames[half:], values[half:], 1) if len(values) - half > 1 else np.zeros(2)
    return float(10_000 * line[0])


def figures_of(soaked: Soaked) -> dict[str, Any]:
    """JSON-ready, with how memory, handles and time grow."""
    windows = [asdict(window) for window in soaked.windows]
    frames = [window.frames for window in soaked.windows]
    growth = {
        name: _slope([float(window[name]) for window in windows], frames)
        for name in ("step_ms", "resident_mb", "handles", "threads")
    }
    return {**asdict(soaked), "windows": windows, "growth_in_10000_frames": growth}


def show(figures: dict[str, Any], console: Console) -> None:
    """A row for every tenth of the stream."""
    table = Table("frames", "ms a step", "slowest 1 %", "MB", "handles", "threads")
    windows = figures["windows"]
    for window in windows[:: max(len(windows) // 10, 1)]:
        times = (f"{window[name]:.2f}" for name in ("step_ms", "slowest_ms"))
        rest = (f"{window['resident_mb']:.0f}", window["handles"], window["threads"])
        table.add_row(str(window["frames"]), *times, *map(str, rest))
    console.print(table)
    console.print(f"largest change of a probability over {figures['compared']} passes: {figures['drift']:.1e}")


@experiment(Config, finished_by="results.json")
def main(config: Config, run: Run) -> None:
    """Write results.json and print a row for every tenth of the stream."""
    classifier = _classifier(config)
    capture = read_capture(config.capture or sample_capture(config.sample, config.assets))
    frames = [read_frames(capture, number) for number in range(capture.frames)]
    pipeline = make_pipeline(capture.cameras, config.pipeline, classifier, key=jax.random.key(config.seed))
    with progress_bar("frames/s") as bar:
        ask = {"total": config.frames, "windows": config.windows, "settled": config.settled}
        figures = figures_of(soak(pipeline, frames, fps=capture.fps, **ask, progress=shown_in(bar)))
    sizes = {
        "cameras": len(capture.cameras),
        "loop": len(frames),
        "pixels": [c.width * c.height for c in capture.cameras],
    }
    notes = {"classifier": classifier.card.name, "pipeline": to_mapping(config.pipeline), "seed": config.seed, **sizes}
    write_json(run.directory / "results.json", {**figures, **notes, **run.origin})
    show(figures, Console())
    Console().print(str(run.directory / "results.json"), soft_wrap=True)


if __name__ == "__main__":
    main()
