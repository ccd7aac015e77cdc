"""Watch a network of cameras that never stop: tracks and labels as they come, as JSON Lines, on a page, to brokers."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import jax
from rich.console import Console

from aerojax import __version__
from aerojax.capture.format import Capture
from aerojax.classify.familiarity import load_familiarity
from aerojax.classify.load import load_classifier
from aerojax.core.files import write_json
from aerojax.core.provenance import provenance
from aerojax.pipeline.step import make_pipeline
from aerojax.serve.config import LivePipelineConfig
from aerojax.serve.messages import health_message
from aerojax.serve.service import Service, ServiceConfig
from aerojax.serve.signals import ended_by_signals
from aerojax.serve.sinks.base import Sink
from aerojax.serve.sinks.json_lines import JsonLines
from aerojax.serve.sinks.mqtt import Mqtt, MqttConfig
from aerojax.serve.sinks.sapient import Sapient
from aerojax.serve.sinks.web import Web, WebConfig
from aerojax.serve.sources.base import SourceConfig
from aerojax.serve.sources.folder import FolderConfig
from experiments._launch.command import Run, experiment


@dataclass(frozen=True, kw_only=True)
class Config:
    """Which cameras, and where to say what they show.

    capture: folder with capture.json, which describes the cameras.
    source: where their pictures come from: a folder that grows, a recording that is played, or streams.
    weights: of a causal classifier; the shipped ones if None.
    output: file that a line of JSON a message is added to; standard output if None.
    sapient: file that SAPIENT detection reports are added to; the cameras need an origin. None if None.
    state: file that an earlier service left, to go on with its tracks, and that this one keeps; if None,
        state.safetensors in the run's directory.
    """

    preset: str
    seed: int = 0
    capture: Path = field(metadata={"given": True})
    source: SourceConfig = field(default_factory=FolderConfig)
    pipeline: LivePipelineConfig = field(default_factory=LivePipelineConfig)
    weights: Path | None = None
    service: ServiceConfig = field(default_factory=ServiceConfig)
    output: Path | None = None
    web: WebConfig = field(default_factory=WebConfig)
    mqtt: MqttConfig = field(default_factory=MqttConfig)
    sapient: Path | None = None
    state: Path | None = None


def _sinks(config: Config, site: Capture, console: Console) -> list[Sink]:
    """The sinks that are asked for."""
    sinks: list[Sink] = [] if config.sapient is None else [Sapient(config.sapient, site)]
    if config.web.port is not None:
        web = Web(config.web)
        console.print(f"page and metrics: {web.address}", soft_wrap=True, markup=False)
        sinks.append(web)
    if config.mqtt.host is not None:
        sinks.append(Mqtt(config.mqtt))
    return [JsonLines(config.output), *sinks]


@experiment(Config)
def main(config: Config, run: Run) -> None:
    """Serve until Ctrl-C or SIGTERM; state.safetensors and summary.json are left."""
    console = Console(stderr=True)
    source = config.source.build(config.capture)
    classifier = load_classifier(config.weights)
    pipeline = make_pipeline(
        source.site.cameras,
        config.pipeline,
        classifier,
        key=jax.random.key(config.seed),
        familiarity=load_familiarity(config.weights),
    )
    with ended_by_signals() as stop:
        service = Service(
            source,
            pipeline,
            _sinks(config, source.site, console),
            config.service,
            state=config.state or run.directory / "state.safetensors",
            version=__version__,
        )
        health = service.run(stop)
    summary = health_message("stopped", service.ended, health)
    write_json(run.directory / "summary.json", {**summary, "command": run.command, **provenance(run.overrides)})
    latency = (
        "" if health.latency_ms is None else " with {:.0f} ms to a track (95 %: {:.0f})".format(*health.latency_ms)
    )
    console.print(
        f"{health.frames} frames, {health.dropped} dropped, {health.rate:.1f} a second{latency}", markup=False
    )


if __name__ == "__main__":
    main()
