"""Measure a classifier on folders of clips: by class, rig, width and distance; sequences without a clip are wrong."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jax
import numpy as np
from rich.console import Console
from rich.table import Table

from aerojax.classify.load import load_classifier
from aerojax.core.errors import UserError
from aerojax.core.files import write_json
from aerojax.core.types import CLASSES
from aerojax.data.manifest import read_datasets
from aerojax.data.splits import Split
from aerojax.evaluate.groups import (
    AnsweredClips,
    answer_figures,
    answer_folder,
    asked_sequences,
    grouped_figures,
    join_answers,
)
from experiments._launch.command import Run, experiment
from experiments._launch.progress import progress_bar


@dataclass(frozen=True, kw_only=True)
class Config:
    """Which weights on which clips.

    weights: of a classifier; the shipped ones if None.
    tests: folders of `generate_clips` or `reconstruct_dataset`, one a rig, that are counted together.
    also: further ones, counted apart; the groups hold both.
    datasets: that the clips were made from; a sequence of theirs whose clip is not in the folder of its rig counts as
        wrong. Folders of rigs that they do not have are taken as they are.
    split: of the folders, which is measured.
    frames: clips are cut or padded to so many.
    cameras: so many of each clip are kept, drawn by its name, for classifiers that read crops; all if None.
    seed, draws: of the intervals.
    """

    preset: str
    weights: Path | None = None
    tests: tuple[Path, ...]
    also: tuple[Path, ...] = ()
    datasets: tuple[Path, ...] = ()
    split: Split = "test"
    frames: int = 10
    cameras: int | None = None
    seed: int = 0
    draws: int = 2000


def _answers(config: Config) -> dict[Path, AnsweredClips]:
    classifier, found = load_classifier(config.weights), {}
    sequences = read_datasets(config.datasets).sequences if config.datasets else ()
    with progress_bar() as bar:
        for folder in bar.track((*config.tests, *config.also), description="folders"):
            asked = asked_sequences(sequences, folder.name, config.split)
            given = {"frames": config.frames, "cameras": config.cameras}
            found[folder] = answer_folder(classifier, folder / config.split, asked=asked, **given)
    return found


def _figures(config: Config, answers: Mapping[Path, AnsweredClips]) -> dict[str, Any]:
    """JSON-ready: a row a folder, all of `tests`, and the groups."""
    ask = {"seed": config.seed, "draws": config.draws}
    return {
        "all": answer_figures(join_answers([answers[folder] for folder in config.tests]), **ask),
        "folders": {str(folder): answer_figures(one, **ask) for folder, one in answers.items()},
        **grouped_figures(join_answers(list(answers.values())), **ask),
    }


def _table(figures: Mapping[str, Any]) -> Table:
    """Short enough for 80 columns; results.json has everything."""
    table = Table("clips of", "number", "lost", "of", "%", "95 %", "ECE", "recall")
    folders = {Path(name).name: row for name, row in figures["folders"].items()}
    rigs = {name: row for name, row in figures["rigs"].items() if name not in folders}
    groups = [("all", figures["all"]), *folders.items(), *rigs.items()]
    for name, unit in (("width_px", "px"), ("distance_m", "m")):
        groups += [(f"{row['low']:g}…{row['high'] or np.inf:g} {unit}", row) for row in figures[name]]
    groups += [("64 to 280 m", row) for row in figures["distance_64_to_280_m"]]
    for name, row in groups:
        low, high = row["interval_95"]
        ece = "-" if row["ece"] is None else f"{row['ece']:.2f}"
        recall = " ".join("-" if share is None else f"{100 * share:.0f}" for share in row["recall"])
        counts = (str(row[key]) for key in ("clips", "missing", "identities"))
        table.add_row(name, *counts, f"{100 * row['accuracy']:.1f}", f"{100 * low:.0f}…{100 * high:.0f}", ece, recall)
    return table


@experiment(Config, finished_by="results.json")
def main(config: Config, run: Run) -> None:
    """Write results.json and print a row a group."""
    if not config.tests:
        raise UserError("missing", "tests is empty", "name folders of clips, such as tests=[data/clips_small/sim1]")
    console, figures = Console(), _figures(config, _answers(config))
    console.print(_table(figures))
    console.print(f"lost: sequences without a clip, wrong; of: individuals; recall: of {', '.join(CLASSES)}, %")
    notes = {"device": jax.devices()[0].device_kind, "seed": config.seed, "classes": CLASSES}
    notes |= {"weights": str(config.weights or "shipped")}
    write_json(run.directory / "results.json", {**figures, **notes, **run.origin})
    console.print(str(run.directory / "results.json"), soft_wrap=True)


if __name__ == "__main__":
    main()
