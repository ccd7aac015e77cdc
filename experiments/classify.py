"""Classify a capture: reconstruct the object in every frame and say drone, bird, helicopter or airplane."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

import jax
import numpy as np
from rich.console import Console
from rich.table import Table

from aerojax.capture.format import Capture, read_capture
from aerojax.classify.load import load_classifier as open_classifier
from aerojax.classify.mambasplat.model import MambaSplat
from aerojax.core.types import CLASSES
from aerojax.pipeline.offline import Clip, PipelineConfig, probabilities_so_far, reconstruct_capture
from aerojax.simulate.sample import SampleConfig, sample_capture
from aerojax.view.report.content import write_report
from aerojax.view.report.gather import classification_report
from experiments._launch.command import REPOSITORY, Run, experiment, write_json
from experiments._launch.progress import progress_bar

PRETRAINED = REPOSITORY / "aerojax" / "classify" / "pretrained" / "mambasplat_ex_small.safetensors"


@dataclass(frozen=True)
class Config:
    """What to classify and with what."""

    preset: str
    seed: int
    capture: Path | None
    object: int | None
    weights: Path | None
    assets: Path
    pipeline: PipelineConfig
    sample: SampleConfig


def load_classifier(weights: Path | None) -> tuple[MambaSplat, int]:
    """A trained model (the shipped one if None) and how many tokens a frame it reads."""
    classifier = open_classifier(weights)
    return classifier.network, classifier.card.tokens


def true_class(capture: Capture, object_id: int | None) -> str | None:
    """The class that the capture's truth gives the object, if it gives one."""
    objects = capture.truth.objects if capture.truth else ()
    named = [o.class_name for o in objects if object_id is None or o.object_id == object_id]
    return named[0] if len(set(named)) == 1 else None


def _result(capture: Capture, clip: Clip, so_far: np.ndarray, latency_ms: dict[str, float]) -> dict[str, object]:
    probabilities = dict(zip(CLASSES, so_far[-1].tolist(), strict=True))
    return {
        "capture": str(capture.folder),
        "label": max(probabilities, key=lambda name: probabilities[name]),
        "probabilities": probabilities,
        "frames": list(clip.frames),
        "dropped": {str(frame): reason for frame, reason in clip.dropped.items()},
        "latency_ms": latency_ms,
        "track": [{"frame": f, "position": p} for f, p in zip(clip.frames, clip.position.tolist(), strict=True)],
    }


def _show(console: Console, result: dict, clip: Clip, capture: Capture, truth: str | None) -> None:
    console.print(f"{capture.folder.name}: [bold]{result['label']}[/bold]", soft_wrap=True)
    table = Table("class", "probability")
    for name, value in sorted(result["probabilities"].items(), key=lambda item: -item[1]):
        table.add_row(name, f"{value:.4f}")
    console.print(table)
    spent = Table("stage", "median ms a frame")
    for name, value in result["latency_ms"].items():
        spent.add_row(name, f"{value:.1f}")
    console.print(spent)
    known = "" if truth is None else f"; truth: {truth}, {'right' if truth == result['label'] else 'wrong'}"
    console.print(f"frames used: {len(clip.frames)} of {capture.frames}, cameras: {len(capture.cameras)}{known}")
    for reason in sorted(set(clip.dropped.values())):
        frames = [frame for frame, why in clip.dropped.items() if why == reason]
        console.print(f"dropped {len(frames)} frame(s) ({', '.join(map(str, frames))}): {reason}")


@experiment(Config)
def main(config: Config, run: Run) -> None:
    """Capture in; table, result.json and report.html out."""
    model, tokens = load_classifier(config.weights)
    capture = read_capture(config.capture or sample_capture(config.sample, config.assets))
    with progress_bar() as bar:
        task = bar.add_task("frames", total=capture.frames)
        clip = reconstruct_capture(
            capture,
            config.pipeline,
            key=jax.random.key(config.seed),
            object_id=config.object,
            progress=lambda done, total, what: bar.update(task, completed=done, description=what),
            keep_images=True,
        )
    columns = clip.gaussians.columns()
    so_far = np.asarray(probabilities_so_far(model, columns, tokens=tokens))  # compiles
    start = time.perf_counter()
    jax.block_until_ready(probabilities_so_far(model, columns, tokens=tokens))
    latency = {**clip.latency_ms, "classify": 1e3 * (time.perf_counter() - start) / len(clip.frames)}
    result = _result(capture, clip, so_far, latency)
    write_json(run.directory / "result.json", result)
    truth = true_class(capture, config.object)
    write_report(run.directory / "report.html", classification_report(capture, clip, so_far, latency, truth))
    console = Console()
    _show(console, result, clip, capture, truth)
    console.print(f"{run.directory / 'result.json'}\n{run.directory / 'report.html'}", soft_wrap=True)


if __name__ == "__main__":
    main()
