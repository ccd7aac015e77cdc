"""Classify archives of captures by several processes, or by the actors of a Ray cluster; goes on after a kill."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from aerojax.core.config import require_at_least
from aerojax.core.errors import UserError
from aerojax.core.files import write_json
from aerojax.core.types import CLASSES
from aerojax.evaluate.labels import label_figures
from aerojax.pipeline.archive import AskedOfCapture, Cluster, answers_in, classify_archive
from experiments._launch.batches import end_batch, find_captures, show_accuracy
from experiments._launch.command import Run, experiment
from experiments._launch.progress import progress_bar, shown_in


@dataclass(frozen=True, kw_only=True)
class Config(AskedOfCapture):
    """Which captures, with what, and by whom.

    captures: folders with capture folders anywhere below them.
    workers: processes, or actors; each has one core.
    cluster: local, processes of this machine; ray, actors of the cluster that RAY_ADDRESS names, or of one that is
        started here. Every machine must find the captures and weights under the same paths.
    """

    preset: str
    captures: tuple[Path, ...] = field(metadata={"given": True})
    workers: int = 2
    cluster: Cluster = "local"

    def __post_init__(self) -> None:
        require_at_least(self, "workers")


def named(folders: tuple[Path, ...]) -> dict[str, Path]:
    """Every capture of some folders by the way to it from there, behind the folder's name where there are several.

    Raises:
        UserError: a folder has none, or two have the same name.
    """
    found: dict[str, Path] = {}
    for folder in folders:
        own = folder.resolve().name
        for way, place in find_captures(folder).items():
            name = own if way == "." else way if len(folders) == 1 else f"{own}/{way}"
            if name in found:
                raise UserError("mismatch", f"captures: {found[name]} and {place} are both {name}", "rename one folder")
            found[name] = place.resolve()
    return found


def figures_of(out: Path, names: list[str]) -> dict[str, Any]:
    """Of the captures whose class is known and that have an answer; empty where there are none."""
    said = [one for one in answers_in(out, names) if one.get("truth") in CLASSES]
    if not said:
        return {}
    rows = np.log(np.maximum([[one["probabilities"][name] for name in CLASSES] for one in said], math.ulp(0.0)))
    return label_figures(rows, np.array([CLASSES.index(one["truth"]) for one in said]))


@experiment(Config, finished_by="metrics.json", ignoring=("workers", "cluster"))
def main(config: Config, run: Run) -> None:
    """Captures in; answers.jsonl and metrics.json out. Exit code 1 if some captures, 2 if all were not classified."""
    folders = named(config.captures)
    asked = AskedOfCapture(config.seed, config.weights and config.weights.resolve(), config.pipeline, config.trust)
    with progress_bar("captures/s") as bar:
        given = {"workers": config.workers, "cluster": config.cluster, "progress": shown_in(bar)}
        counts = classify_archive(folders, asked, run.directory, **given)
    figures = figures_of(run.directory, sorted(folders))
    content: Mapping[str, Any] = {"captures": len(folders), "statuses": dict(counts), "figures": figures}
    write_json(run.directory / "metrics.json", {**content, "classes": CLASSES, **run.origin})
    console = Console()
    console.print(", ".join(f"{count} {status}" for status, count in counts.most_common()))
    show_accuracy(console, figures)
    console.print(str(run.directory / "answers.jsonl"), soft_wrap=True, markup=False)
    end_batch(counts["error"], counts.total() - counts["error"], "were not classified")


if __name__ == "__main__":
    main()
