"""Measure what frames, their order and the distance do to answers: after each frame, far away, with frames shuffled."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from aerojax.classify.load import load_classifier
from aerojax.core.errors import UserError
from aerojax.core.files import write_json, write_text
from aerojax.data.clips import load_clips
from aerojax.evaluate.temporal import TemporalTrials, temporal_answers, temporal_figures
from aerojax.view.temporal import temporal_plots
from experiments._launch.command import Run, experiment
from experiments._launch.progress import progress_bar, shown_in


@dataclass(frozen=True, kw_only=True)
class Config:
    """Which weights on which clips.

    models: weights, or names of shipped ones. tests: folders of clips, one a rig, whose test/ is counted together.
    frames: clips are cut or padded to so many. trials: how they are asked.
    """

    preset: str
    models: tuple[str, ...] = ("mambasplat", "views")
    tests: tuple[Path, ...]
    frames: int = 10
    trials: TemporalTrials = field(default_factory=TemporalTrials)


def _table(models: list[dict[str, Any]]) -> Table:
    """One frame, all of them, and how much shuffling costs, by class."""
    table = Table("model", "class", "one frame, %", "all, %", "shuffled costs", "95 %")
    for model in models:
        columns = zip(model["first"], model["whole"], model["shuffled"], strict=True)
        for first, whole, lost in columns:
            shares = (f"{100 * row['accuracy']:.1f}" for row in (first, whole, lost))
            table.add_row(model["name"], whole["class"], *shares, f"{100 * lost['low']:.1f}…{100 * lost['high']:.1f}")
    return table


@experiment(Config, finished_by="results.json")
def main(config: Config, run: Run) -> None:
    """Write results.json and plots, and print a row a class."""
    if not config.tests:
        raise UserError("missing", "tests is empty", "name folders of clips, such as tests=[data/clips_small/sim1]")
    clips, models = load_clips(*(folder / "test" for folder in config.tests), frames=config.frames), []
    for name in config.models:
        classifier = load_classifier(Path(name))
        with progress_bar() as bar:
            answers = temporal_answers(classifier, clips, config.trials, shown_in(bar))
        figures = temporal_figures(answers, clips.classes, config.trials)
        models.append({"name": Path(name).stem, "label": classifier.card.name, **figures})
        for plot, text in temporal_plots(classifier.card.name, figures, clips.classes).items():
            write_text(run.directory / f"{Path(name).stem}_{plot}.svg", text)
    Console().print(_table(models))
    notes = {"classes": clips.classes, "orders": config.trials.orders, "seed": config.trials.seed}
    write_json(run.directory / "results.json", {"models": models, **notes, **run.origin})
    Console().print(str(run.directory / "results.json"), soft_wrap=True)


if __name__ == "__main__":
    main()
