"""Classify a capture: reconstruct the object in every frame and say drone, bird, helicopter or airplane."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import jax
import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from aerojax.capture.format import Capture, read_capture
from aerojax.classify.load import load_classifier
from aerojax.core.files import write_json
from aerojax.pipeline.config import PipelineConfig
from aerojax.pipeline.offline import Clip, reconstruct_capture
from aerojax.pipeline.results import headline, result_of
from aerojax.pipeline.trust import TrustConfig
from aerojax.simulate.sample import SampleConfig, sample_capture
from aerojax.view.report.gather import Answer, classification_report
from aerojax.view.report.page import write_report
from experiments._launch.command import Run, experiment
from experiments._launch.progress import progress_bar


@dataclass(frozen=True, kw_only=True)
class Config:
    """What to classify and with what.

    capture: folder of a capture; a held-out identity is simulated where none is given.
    object: instance id in the masks; the largest object if None.
    weights: of a trained classifier; the shipped ones if None.
    assets: where the simulated identity's stage lies.
    trust: from when on the answer is believed.
    """

    preset: str
    seed: int = 0
    capture: Path | None = None
    object: int | None = None
    weights: Path | None = None
    assets: Path = Path("data/assets")
    pipeline: PipelineConfig = field(default_factory=PipelineConfig)
    trust: TrustConfig = field(default_factory=TrustConfig)
    sample: SampleConfig = field(default_factory=SampleConfig)


def _answer(clip: Clip, result: dict[str, Any], truth: str | None) -> Answer:
    assert clip.log_probabilities is not None  # there was a classifier
    return Answer(
        observations=clip.observations,
        gaussians=clip.in_world(),
        position=clip.position,
        so_far=np.exp(clip.log_probabilities),
        dropped={event.frame: event.text for event in clip.dropped},
        latency_ms=clip.latency_ms,
        truth=truth,
        sure=result["status"] == "ok",
        reasons=[reason["text"] for reason in result["reasons"]],
        agreement=result["cameras"],
    )


def _show(console: Console, result: dict[str, Any], capture: Capture, truth: str | None) -> None:
    console.print(f"{capture.folder.name}: [bold]{escape(headline(result))}[/bold]", soft_wrap=True)
    table = Table("class", "probability")
    for name, value in sorted(result["probabilities"].items(), key=lambda item: -item[1]):
        table.add_row(name, f"{value:.4f}")
    console.print(table)
    spent = Table("stage", "median ms a frame")
    for name, value in result["latency_ms"].items():
        spent.add_row(name, f"{value:.1f}")
    console.print(spent)
    known = "" if truth is None else f"; truth: {truth}, {'right' if truth == result['most_likely'] else 'wrong'}"
    console.print(f"frames used: {len(result['frames'])} of {capture.frames}, cameras: {len(capture.cameras)}{known}")
    reasons = {frame: event["text"] for frame, event in result["dropped"].items()}
    for reason in sorted(set(reasons.values())):
        frames = [frame for frame, why in reasons.items() if why == reason]
        console.print(f"dropped {len(frames)} frame(s) ({', '.join(frames)}): {reason}")
    for warning in result["warnings"]:
        console.print(f"[yellow]warning:[/yellow] {escape(warning)}", soft_wrap=True)


@experiment(Config)
def main(config: Config, run: Run) -> None:
    """Capture in; table, result.json and report.html out."""
    classifier = load_classifier(config.weights)
    capture = read_capture(config.capture or sample_capture(config.sample, config.assets))
    with progress_bar() as bar:
        task = bar.add_task("frames", total=capture.frames)
        clip = reconstruct_capture(
            capture,
            config.pipeline,
            classifier,
            key=jax.random.key(config.seed),
            object_id=config.object,
            trust=config.trust,
            progress=lambda done, total, what: bar.update(task, completed=done, description=what),
            keep_observations=True,
        )
    truth = capture.true_class(config.object)
    result = result_of(capture, clip)
    answer = _answer(clip, result, truth)
    write_json(run.directory / "result.json", result)
    write_report(run.directory / "report.html", classification_report(capture, answer))
    console = Console()
    _show(console, result, capture, truth)
    console.print(f"{run.directory / 'result.json'}\n{run.directory / 'report.html'}", soft_wrap=True)


if __name__ == "__main__":
    main()
