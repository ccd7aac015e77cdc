"""Measure whether things of none of the classes are called unknown, and what answers and sets of classes hold."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jax
from rich.console import Console
from rich.table import Table

from aerojax.classify.answer_sets import family_of
from aerojax.classify.familiarity import load_familiarity
from aerojax.classify.load import load_classifier
from aerojax.core.errors import UserError
from aerojax.core.files import write_json
from aerojax.data.splits import Split
from aerojax.evaluate.calibration import calibration_error_by_chance
from aerojax.evaluate.unknown import alarms, rejection, separation, set_figures
from aerojax.pipeline.factory.write import OUTLIERS
from aerojax.pipeline.trust import TrustConfig
from experiments._launch.command import Run, experiment
from experiments._launch.judged_clips import judge_folders, require_features
from experiments._launch.progress import progress_bar


@dataclass(frozen=True, kw_only=True)
class Config:
    """Which weights on which clips.

    weights: of a classifier with a familiarity beside them; the shipped ones if None.
    clips: folders of `generate_clips`, one a rig, with clips of the classes in <split>/ and of outliers in
        outliers_<split>/, before equal cameras.
    also: folders of other clips of the classes, such as rendered sequences; each is counted apart.
    split: test for kinds that nobody has looked at, val for those that the score was chosen by.
    frames: clips are cut or padded to so many.
    level: what is less familiar is called unknown; that of the pipeline if None.
    seed, draws: of the intervals.
    """

    preset: str
    weights: Path | None = None
    clips: tuple[Path, ...]
    also: tuple[Path, ...] = ()
    split: Split = "test"
    frames: int = 12
    level: float | None = None
    seed: int = 0
    draws: int = 1000


def _figures(config: Config) -> dict[str, Any]:
    """JSON-ready: of the folders together, and the same of each of `also` against the same outliers."""
    classifier, familiarity = require_features(load_classifier(config.weights)), load_familiarity(config.weights)
    if familiarity is None:
        raise UserError("missing", "there is no familiarity beside the weights", "make one with fit_familiarity")
    level = TrustConfig().least_familiarity if config.level is None else config.level
    strange, _ = judge_folders(classifier, familiarity, config.clips, f"{OUTLIERS}{config.split}", frames=config.frames)
    sides = {"all": config.clips, **{folder.name: (folder,) for folder in config.also}}
    found: dict[str, Any] = {"outliers": dict(Counter(strange.group)), "individuals": len(set(strange.identity))}
    with progress_bar() as bar:
        for name, folders in bar.track(sides.items(), description="known clips"):
            known, label = judge_folders(classifier, familiarity, folders, config.split, frames=config.frames)
            found[name] = {
                "clips": len(label),
                "identities": len(set(known.identity)),
                **separation(known, strange, seed=config.seed, draws=config.draws),
                **rejection(known, label, strange, level),
                "ece_by_chance": calibration_error_by_chance(
                    known.log_probabilities, seed=config.seed, draws=config.draws
                ),
                "alarms": alarms(known, label, strange, level),
            }
            if known.held is not None:
                family = [family_of(name) for name in known.identity]
                stated = {"stated": round(float(familiarity.coverage[0]), 6)}
                found[name]["sets"] = stated | set_figures(known.held, label, family)
    return found


def _table(figures: dict[str, Any], sides: list[str]) -> Table:
    head = ("known clips", "number", "AUROC", "of probability", "ECE", "called unknown", "outliers called so")
    table = Table(*head, "class in set", "classes in set")
    for name in sides:
        row = figures[name]
        shares = (f"{row[key]:.1%}" for key in ("known_called_unknown", "strange_called_unknown"))
        areas = (f"{row[key]:.3f}" for key in ("auroc", "auroc_of_probability", "ece"))
        sets = (f"{row['sets']['coverage']:.1%}", f"{row['sets']['mean_size']:.2f}") if "sets" in row else ("-", "-")
        table.add_row(name, str(row["clips"]), *areas, *shares, *sets)
    return table


@experiment(Config, finished_by="results.json")
def main(config: Config, run: Run) -> None:
    """Write results.json and print a row a set of known clips, and the kinds of outliers."""
    console, figures = Console(), _figures(config)
    console.print(_table(figures, ["all", *(folder.name for folder in config.also)]))
    for kind, share in figures["all"]["strange_by_group"].items():
        console.print(f"{kind}: {share:.1%} of {figures['outliers'][kind]} called unknown")
    notes = {"device": jax.devices()[0].device_kind, "seed": config.seed}
    notes |= {"weights": str(config.weights or "shipped")}
    write_json(run.directory / "results.json", {**figures, **notes, **run.origin})
    console.print(str(run.directory / "results.json"), soft_wrap=True)


if __name__ == "__main__":
    main()
