"""Run the pipeline, or the service, over a stream without end: time, memory, handles and the answer must stay."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import jax
from rich.console import Console

from aerojax import __version__
from aerojax.capture.format import Capture, read_capture
from aerojax.capture.frames import read_frames
from aerojax.classify.base import Trainable, with_card
from aerojax.classify.familiarity import load_familiarity
from aerojax.classify.load import load_classifier
from aerojax.core.config import to_mapping
from aerojax.core.errors import UserError
from aerojax.core.files import write_json
from aerojax.pipeline.config import PipelineConfig, clip_settings
from aerojax.pipeline.soak import soak
from aerojax.pipeline.step import Pipeline, make_pipeline
from aerojax.serve.sinks.json_lines import JsonLines
from aerojax.serve.sinks.web import Web, WebConfig
from aerojax.serve.soak import soak_service
from aerojax.serve.sources.playback import PlaybackConfig
from aerojax.simulate.sample import SampleConfig, sample_capture
from experiments._launch.command import Run, experiment
from experiments._launch.progress import progress_bar, shown_in
from experiments._soak.growth import figures_of, growth_of, show

Progress = Callable[[int, int, str], None]


@dataclass(frozen=True, kw_only=True)
class Config:
    """What flows, and how long.

    frames: steps. windows: into which they are divided.
    service: runs the service of `serve` instead of the pipeline alone: the images are read from their files each time,
        messages, a page and the state are written. `segment=voxel_vote track=several` is what it looks for by default.
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
    service: bool = False
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


def _pipeline_figures(config: Config, pipeline: Pipeline, capture: Capture, progress: Progress) -> dict[str, Any]:
    """The pipeline alone, over frames in memory."""
    frames = [read_frames(capture, number) for number in range(capture.frames)]
    ask = {"total": config.frames, "windows": config.windows, "settled": config.settled}
    return figures_of(soak(pipeline, frames, fps=capture.fps, **ask, progress=progress))


def _service_figures(
    config: Config, pipeline: Pipeline, capture: Capture, run: Run, progress: Progress
) -> dict[str, Any]:
    """The service, over files that are played as fast as they are taken."""
    source = PlaybackConfig(rate=0, repeat=0).build(capture.folder)
    sinks = (JsonLines(run.directory / "messages.jsonl"), Web(WebConfig(port=0)))
    ask = {"total": config.frames, "windows": config.windows, "progress": progress}
    state = run.directory / "state.safetensors"
    windows, health = soak_service(source, pipeline, sinks, state=state, version=__version__, **ask)
    rows = [asdict(window) for window in windows]
    said = {"sightings": dict(health.sightings), "dropped": health.dropped, "partial": health.partial}
    said |= {"failed_sends": dict(health.failed_sends), "stages_ms": dict(health.stages_ms)}
    return {"windows": rows, "frames": health.frames, **said, "growth_in_10000_frames": growth_of(rows)}


@experiment(Config, finished_by="results.json")
def main(config: Config, run: Run) -> None:
    """Write results.json and print a row for every tenth of the stream."""
    classifier = _classifier(config)
    capture = read_capture(config.capture or sample_capture(config.sample, config.assets))
    given = {"key": jax.random.key(config.seed), "familiarity": load_familiarity(config.weights)}
    pipeline = make_pipeline(capture.cameras, config.pipeline, classifier, **given)
    with progress_bar("frames/s") as bar:
        if config.service:
            figures = _service_figures(config, pipeline, capture, run, shown_in(bar))
        else:
            figures = _pipeline_figures(config, pipeline, capture, shown_in(bar))
    sizes = {
        "cameras": len(capture.cameras),
        "loop": capture.frames,
        "pixels": [c.width * c.height for c in capture.cameras],
    }
    notes = {"classifier": classifier.card.name, "pipeline": to_mapping(config.pipeline), "seed": config.seed, **sizes}
    write_json(run.directory / "results.json", {**figures, **notes, **run.origin})
    show(figures, Console())
    Console().print(str(run.directory / "results.json"), soft_wrap=True)


if __name__ == "__main__":
    main()
