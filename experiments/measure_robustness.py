"""Measure accuracy against faults: calibration, clocks, masks, lost cameras, size and distance, one at a time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import jax
from rich.console import Console

from aerojax.classify.load import load_classifier
from aerojax.core.config import to_mapping
from aerojax.core.files import write_json, write_text
from aerojax.evaluate.groups import AnsweredClips, AskedClip, answer_folder
from aerojax.evaluate.robustness import TITLES, LevelAnswers, robustness_markdown, robustness_rows
from aerojax.pipeline.config import clip_settings
from aerojax.pipeline.factory.levels import BASE, CurveLevels, LevelsConfig, levels_of, names_of
from aerojax.pipeline.factory.paired import make_levels
from aerojax.view.robustness import robustness_svg
from experiments._launch.command import Run, experiment
from experiments._launch.progress import progress_bar, shown_in


@dataclass(frozen=True, kw_only=True)
class Config(LevelsConfig):
    """Which weights, and where the clips are kept.

    weights: of a classifier; the shipped ones if None.
    folder: of the clips; other weights are measured on the same ones.
    workers: processes that make clips.
    seed, draws: of the intervals.
    """

    preset: str
    weights: Path | None = None
    folder: Path
    workers: int = 2
    seed: int = 0
    draws: int = 2000


def _answers(config: Config, progress: Callable[[int, int, str], None]) -> dict[str, AnsweredClips]:
    """By level: answers to every clip that should be there."""
    classifier, split = load_classifier(config.weights), config.factory.split
    asked = {name: AskedClip(one.label, one.name) for name, one in names_of(config)}
    levels, found = dict.fromkeys(level.folder for level in levels_of(config)), {}
    for done, level in enumerate(levels, start=1):
        folder = config.folder / level / split
        found[level] = answer_folder(classifier, folder, frames=config.factory.frames, asked=asked)
        progress(done, len(levels), "levels answered")
    return found


def _rows(config: Config, answers: dict[str, AnsweredClips]) -> list[dict[str, Any]]:
    most, said = config.factory.rigs.cameras[1], {BASE: f"{config.factory.rigs.cameras[1]} cameras"}
    if config.curves.combined:
        said["combined"] = "{:g}°, {:g} ms, {:g} of {} cameras lost".format(*config.curves.combined, most)
    every = levels_of(config)
    levels = [LevelAnswers(one.factor, one.value, answers[one.folder], said.get(one.factor, "")) for one in every]
    return robustness_rows(answers[BASE], levels, seed=config.seed, draws=config.draws)


@experiment(Config, finished_by="results.json")
def main(config: Config, run: Run) -> None:
    """Make the clips that are missing, ask, and write results.json, table.md and curves.svg."""
    classifier, console = load_classifier(config.weights), Console()
    classifier.card.require(clip_settings(config.factory.pipeline))
    with progress_bar() as bar:
        plain = LevelsConfig(factory=config.factory, curves=config.curves)
        made = make_levels(plain, config.folder, workers=config.workers, progress=shown_in(bar))
        rows = _rows(config, _answers(config, shown_in(bar)))
    curves = {item.name: [row for row in rows if row["factor"] == item.name] for item in fields(CurveLevels)}
    curves = {name: levels for name, levels in curves.items() if name != "combined" and levels}
    individuals = 4 * config.factory.individuals
    about = f"{classifier.card.name}: {individuals} individuals of the {config.factory.split} families, "
    about += f"{config.factory.clips} clip(s) each of {config.factory.frames} frames; the same clips at every level."
    write_text(run.directory / "table.md", robustness_markdown(rows, about=about))
    write_text(run.directory / "curves.svg", robustness_svg(curves, TITLES))
    notes = {
        "weights": str(config.weights or classifier.card.name),
        "rows": rows,
        "undrawn": made.undrawn,
        "factory": to_mapping(config.factory),
        "seeds": {"clips": config.factory.seed, "intervals": config.seed},
        "device": jax.devices()[0].device_kind,
    }
    write_json(run.directory / "results.json", {**notes, **run.origin})
    console.print((run.directory / "table.md").read_text(), soft_wrap=True)
    console.print(str(run.directory / "results.json"), soft_wrap=True)


if __name__ == "__main__":
    main()
