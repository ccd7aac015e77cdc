"""Fit what tells strange objects from those that a classifier knows; it is kept beside the classifier's weights."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from aerojax.classify.answer_sets import family_of
from aerojax.classify.base import Embedding
from aerojax.classify.card_markdown import familiarity_markdown
from aerojax.classify.familiarity import (
    Familiarity,
    KnownClips,
    familiarity_path,
    fit_familiarity,
    save_familiarity,
)
from aerojax.classify.load import load_classifier
from aerojax.core.errors import UserError
from aerojax.core.files import write_json, write_text
from aerojax.evaluate.answers import answers_with_features, load_split
from aerojax.evaluate.unknown import rejection, separation
from aerojax.pipeline.factory.write import OUTLIERS
from aerojax.pipeline.trust import TrustConfig
from experiments._launch.command import Run, experiment
from experiments._launch.judged_clips import judge_folders, require_features


@dataclass(frozen=True, kw_only=True)
class Config:
    """Of which weights, from which clips.

    weights: of a classifier; the result is written beside them.
    clips: folders of `generate_clips`, one a rig: train/ is what the classifier knows, val/ are the known objects that
        others are compared with, and outliers_val/, if all have one, says how well that works.
    frames: clips are cut or padded to so many.
    seed, draws: of the intervals.
    """

    preset: str
    weights: Path = field(metadata={"given": True})
    clips: tuple[Path, ...]
    frames: int = 12
    seed: int = 0
    draws: int = 1000


def _fitted(config: Config, classifier: Embedding, console: Console) -> tuple[Familiarity, dict[str, Any]]:
    """The familiarity, and how many clips it is made from."""
    train, val = (load_split(config.clips, split, config.frames) for split in ("train", "val"))
    if missing := [name for i, name in enumerate(train.classes) if i not in train.label]:
        raise UserError("missing", f"no training clips of {', '.join(missing)}", "give clips of every class")
    console.print(f"clips: {len(train.label)} train, {len(val.label)} val")
    features = answers_with_features(classifier, train)[1][:, -1]
    said, seen = answers_with_features(classifier, val)
    known = KnownClips(seen, said, val.present, val.label, val.identity)
    counts = {"training_clips": len(train.label), "validation_clips": len(val.label)}
    counts["validation_families"] = len(set(map(family_of, val.identity)))
    return fit_familiarity(features, train.label, known, classifier.feature_weights), counts


def _figures(config: Config, classifier: Embedding, familiarity: Familiarity) -> dict[str, Any]:
    """Of validation: how well its outliers are told; what is asked of them decided the score."""
    if not all((folder / f"{OUTLIERS}val").is_dir() for folder in config.clips):
        return {}
    known, label = judge_folders(classifier, familiarity, config.clips, "val", frames=config.frames)
    strange, _ = judge_folders(classifier, familiarity, config.clips, f"{OUTLIERS}val", frames=config.frames)
    level = TrustConfig().least_familiarity
    found = separation(known, strange, seed=config.seed, draws=config.draws)
    return found | rejection(known, label, strange, level) | {"outliers": dict(Counter(strange.group))}


@experiment(Config)
def main(config: Config, run: Run) -> None:
    """Fit, write it and a page about it beside the weights, and metrics.json."""
    classifier, console = require_features(load_classifier(config.weights)), Console()
    if not config.weights.is_file():
        raise UserError("missing", f"weights={config.weights} is no file to write beside", "copy the weights first")
    familiarity, counts = _fitted(config, classifier, console)
    found = _figures(config, classifier, familiarity)
    record: dict[str, Any] = {
        "seed": config.seed,
        "clips": list(map(str, config.clips)),
        **counts,
        "validation": found,
        **run.origin,
    }
    page = save_familiarity(config.weights, familiarity, record).with_suffix(".md")
    write_text(page, familiarity_markdown(classifier.card.name, record))
    write_json(run.directory / "metrics.json", record)
    if found:
        console.print(
            f"validation outliers: AUROC {found['auroc']:.3f}, {found['strange_called_unknown']:.1%} called unknown at "
            f"{found['known_called_unknown']:.1%} of the known objects"
        )
    sizes = ", ".join(f"{name} {np.shape(getattr(familiarity, name))}" for name in ("mean", "whitening", "known"))
    console.print(f"{familiarity_path(config.weights)}: {sizes}", soft_wrap=True, markup=False)


if __name__ == "__main__":
    main()
