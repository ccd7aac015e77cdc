"""Classify a capture: reconstruct the object in every frame and say drone, bird, helicopter or airplane."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import jax
import numpy as np
from rich.console import Console

from aerojax import __version__
from aerojax.capture.format import read_capture
from aerojax.classify.card import Card
from aerojax.classify.familiarity import load_familiarity
from aerojax.classify.load import load_classifier
from aerojax.core.files import write_json
from aerojax.evaluate.saliency import explanation
from aerojax.pipeline.config import PipelineConfig
from aerojax.pipeline.exports.export import ExportName, require_exports
from aerojax.pipeline.offline import Clip, reconstruct_capture
from aerojax.pipeline.results import result_of
from aerojax.pipeline.trust import TrustConfig
from aerojax.simulate.sample import SampleConfig, sample_capture
from aerojax.view.report.gather import Answer, classification_report, weights_named
from aerojax.view.report.page import write_report
from experiments._launch.answer_screen import show_answer
from experiments._launch.command import Run, experiment
from experiments._launch.exports import export_with_bar
from experiments._launch.progress import progress_bar


@dataclass(frozen=True, kw_only=True)
class Config:
    """What to classify and with what.

    capture: folder of a capture; a held-out identity is simulated where none is given.
    object: instance id in the masks; the largest object if None.
    weights: of a trained classifier; the shipped ones if None.
    assets: where the simulated identity's stage lies.
    trust: from when on the answer is believed.
    export: what to take along, into export/: ply and usd (Gaussians), csv and jsonl (track), coco (masks and boxes in
        the images), video (overlays and a mosaic), sapient (detection reports; the capture needs an origin).
    began: time of frame 0 in exports that need one, ISO 8601.
    explain: also say which frames and Gaussians the answer stands on, in the report and in explanation.json; not where
        the object has no place.
    """

    preset: str
    seed: int = 0
    capture: Path | None = field(default=None, metadata={"given": True})
    object: int | None = None
    weights: Path | None = None
    assets: Path = Path("data/assets")
    pipeline: PipelineConfig = field(default_factory=PipelineConfig)
    trust: TrustConfig = field(default_factory=TrustConfig)
    sample: SampleConfig = field(default_factory=SampleConfig)
    export: tuple[ExportName, ...] = ()
    began: str = "1970-01-01T00:00:00Z"
    explain: bool = False


def _answer(
    clip: Clip, result: dict[str, Any], truth: str | None, card: Card, explained: dict[str, Any] | None
) -> Answer:
    assert clip.log_probabilities is not None  # there was a classifier
    return Answer(
        observations=clip.observations,
        gaussians=clip.gaussians,
        position=clip.position,
        so_far=np.exp(clip.log_probabilities),
        dropped={event.frame: event.text for event in clip.dropped},
        latency_ms=clip.latency_ms,
        truth=truth,
        status=result["status"],
        result=result,
        explanation=explained,
        made_by={"aerojax": __version__, **weights_named(card.name, card.member, card.record)},
    )


@experiment(Config)
def main(config: Config, run: Run) -> None:
    """Capture in; table, result.json and report.html out."""
    classifier = load_classifier(config.weights)
    capture = read_capture(config.capture or sample_capture(config.sample, config.assets))
    require_exports(capture, config.export, config.began)
    with progress_bar() as bar:
        task = bar.add_task("frames", total=capture.frames)
        clip = reconstruct_capture(
            capture,
            config.pipeline,
            classifier,
            key=jax.random.key(config.seed),
            object_id=config.object,
            trust=config.trust,
            familiarity=load_familiarity(config.weights),
            progress=lambda done, total, what: bar.update(task, completed=done, description=what),
            keep_observations=True,
        )
    truth = capture.true_class(config.object)
    result = result_of(capture, clip)
    explained = explanation(classifier, clip.seen, seed=config.seed) if config.explain and clip.frames else None
    answer = _answer(clip, result, truth, classifier.card, explained)
    write_json(run.directory / "result.json", result)
    write_report(run.directory / "report.html", classification_report(capture, answer))
    taken = export_with_bar(capture, clip, config.export, run.directory / "export", began=config.began)
    if explained is not None:
        write_json(taken.setdefault("explanation", run.directory / "explanation.json"), explained)
    console = Console()
    show_answer(console, result, capture, truth)
    written = [run.directory / "result.json", run.directory / "report.html", *taken.values()]
    console.print("\n".join(map(str, written)), soft_wrap=True, markup=False)


if __name__ == "__main__":
    main()
