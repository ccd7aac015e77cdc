"""Classify every capture of a folder and compare with their truths: accuracy and confusion in one table."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from aerojax.classify.familiarity import load_familiarity
from aerojax.classify.load import load_classifier
from aerojax.core.errors import UserError, failure
from aerojax.core.files import write_json
from aerojax.core.types import CLASSES
from aerojax.evaluate.labels import label_figures
from aerojax.pipeline.archive import AskedOfCapture, classify_one
from experiments._launch.batches import end_batch, find_captures, show_accuracy
from experiments._launch.command import Run, experiment
from experiments._launch.progress import progress_bar


@dataclass(frozen=True, kw_only=True)
class Config(AskedOfCapture):
    """Which captures, and with what.

    captures: folder with capture folders anywhere below it.
    """

    preset: str
    captures: Path = field(metadata={"given": True})


def show(console: Console, rows: list[dict[str, Any]], figures: dict[str, Any]) -> None:
    """The table, and every capture that was not classified with its reason."""
    table = Table("capture", "truth", "answer", "most likely", "status", "probability", "frames")
    for row in rows:
        if "error" not in row:
            surest = max(row["probabilities"].values())
            used, all_frames = row["frames"]
            names = (row["truth"] or "-", row["label"] or "-", row["most_likely"], row["status"])
            table.add_row(escape(row["capture"]), *names, f"{surest:.3f}", f"{used}/{all_frames}")
    console.print(table)
    for row in rows:
        for reason in row.get("reasons", ()):
            console.print(f"{row['capture']}: {row['status']}: {reason['text']}", soft_wrap=True, markup=False)
        if "error" in row:
            console.print(f"{row['capture']}: not classified: {row['error']['text']}", soft_wrap=True, markup=False)
    show_accuracy(console, figures)


@experiment(Config)
def main(config: Config, run: Run) -> None:
    """Captures in; table and metrics.json out. Exit code 1 if some captures, 2 if all were not classified."""
    folders = find_captures(config.captures)
    classifier, familiarity = load_classifier(config.weights), load_familiarity(config.weights)
    rows: list[dict[str, Any]] = []
    known: list[tuple[np.ndarray, int]] = []  # log-probabilities and truth
    figures: dict[str, Any] = {}
    with progress_bar() as bar:
        for name, folder in bar.track(folders.items(), description="captures"):
            try:
                row, last = classify_one(folder, config, classifier, familiarity)
                rows.append({"capture": name, **row})
                if row["truth"] in CLASSES:  # not of outliers
                    known.append((last, CLASSES.index(row["truth"])))
                    figures = label_figures(np.stack([x for x, _ in known]), np.array([c for _, c in known]))
            except (UserError, OSError) as error:
                rows.append({"capture": name, "error": failure(error)})
            content = {"captures": rows, "figures": figures, "classes": CLASSES, **run.origin}
            write_json(run.directory / "metrics.json", content)  # after each, so that a killed run leaves what it knows
    show(Console(), rows, figures)
    failed = sum("error" in row for row in rows)
    end_batch(failed, len(rows) - failed, "were not classified")


if __name__ == "__main__":
    main()
