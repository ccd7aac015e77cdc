"""Classify every capture of a folder and compare with their truths: accuracy and confusion in one table."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import jax
import numpy as np
from rich.console import Console
from rich.table import Table

from aerojax.capture.format import read_capture
from aerojax.core.errors import UserError
from aerojax.core.types import CLASSES
from aerojax.evaluate.labels import label_figures
from aerojax.pipeline.offline import PipelineConfig, probabilities_so_far, reconstruct_capture
from experiments._launch.command import Run, experiment, provenance, write_json
from experiments._launch.progress import progress_bar
from experiments.classify import load_classifier, true_class


@dataclass(frozen=True)
class Config:
    """Which captures, and with what."""

    preset: str
    seed: int
    captures: Path
    weights: Path | None
    pipeline: PipelineConfig


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
    model, tokens = load_classifier(config.weights)
    table = Table("capture", "truth", "label", "probability", "frames")
    rows, known, labels = [], [], []
    with progress_bar() as bar:
        for folder in bar.track(folders, description="captures"):
            capture = read_capture(folder)
            clip = reconstruct_capture(capture, config.pipeline, key=jax.random.key(config.seed))
            last = np.asarray(probabilities_so_far(model, clip.gaussians.columns(), tokens=tokens))[-1]
            truth, label = true_class(capture, None), CLASSES[int(np.argmax(last))]
            table.add_row(folder.name, truth or "-", label, f"{last.max():.3f}", f"{len(clip.frames)}/{capture.frames}")
            probabilities = dict(zip(CLASSES, last.tolist(), strict=True))
            rows.append({"capture": folder.name, "truth": truth, "label": label, "probabilities": probabilities})
            if truth is not None:
                known.append(np.log(np.maximum(last, 1e-12)))
                labels.append(CLASSES.index(truth))
    figures = label_figures(np.stack(known), np.array(labels)) if known else {}
    console = Console()
    console.print(table)
    if figures:
        console.print(
            f"right: {round(figures['accuracy'] * figures['clips'])} of {figures['clips']} with a known class"
        )
    write_json(
        run.directory / "metrics.json",
        {"captures": rows, "figures": figures, "classes": CLASSES, **provenance(run.overrides)},
    )


if __name__ == "__main__":
    main()
