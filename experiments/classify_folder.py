"""Classify every capture of a folder and compare with their truths: accuracy and confusion in one table."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import jax
import numpy as np
from rich.console import Console
from rich.table import Table

from aerojax.capture.format import read_capture
from aerojax.classify.load import load_classifier
from aerojax.core.errors import UserError
from aerojax.core.files import write_json
from aerojax.core.provenance import provenance
from aerojax.core.types import CLASSES
from aerojax.evaluate.labels import label_figures
from aerojax.pipeline.config import PipelineConfig
from aerojax.pipeline.offline import reconstruct_capture
from experiments._launch.command import Run, experiment
from experiments._launch.progress import progress_bar


@dataclass(frozen=True, kw_only=True)
class Config:
    """Which captures, and with what.

    captures: folder that holds capture folders.
    weights: of a trained classifier; the shipped ones if None.
    """

    preset: str
    seed: int = 0
    captures: Path
    weights: Path | None = None
    pipeline: PipelineConfig = field(default_factory=PipelineConfig)


@experiment(Config)
def main(config: Config, run: Run) -> None:
    """Captures in; table and metrics.json out."""
    folders = sorted(p.parent for p in config.captures.glob("*/capture.json"))
    if not folders:
        raise UserError(
            "missing",
            f"captures={config.captures} holds no folder with a capture.json",
            "name the folder above the captures",
        )
    classifier = load_classifier(config.weights)
    table = Table("capture", "truth", "label", "probability", "frames")
    rows, known, labels = [], [], []
    with progress_bar() as bar:
        for folder in bar.track(folders, description="captures"):
            capture = read_capture(folder)
            clip = reconstruct_capture(capture, config.pipeline, classifier, key=jax.random.key(config.seed))
            assert clip.log_probabilities is not None  # there was a classifier
            last = clip.log_probabilities[-1]
            truth, label = capture.true_class(None), CLASSES[int(np.argmax(last))]
            frames = f"{len(clip.frames)}/{capture.frames}"
            table.add_row(folder.name, truth or "-", label, f"{np.exp(last.max()):.3f}", frames)
            probabilities = dict(zip(CLASSES, np.exp(last).tolist(), strict=True))
            rows.append({"capture": folder.name, "truth": truth, "label": label, "probabilities": probabilities})
            if truth is not None:
                known.append(last)
                labels.append(CLASSES.index(truth))
    figures = label_figures(np.stack(known), np.array(labels)) if known else {}
    console = Console()
    console.print(table)
    if figures:
        right = round(figures["accuracy"] * figures["clips"])
        console.print(f"right: {right} of {figures['clips']} with a known class")
    write_json(
        run.directory / "metrics.json",
        {"captures": rows, "figures": figures, "classes": CLASSES, **provenance(run.overrides)},
    )


if __name__ == "__main__":
    main()
