"""Measure a classifier under every rotation protocol: clip and video figures, calibration, intervals, prefixes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console

from aerojax.classify.base import Classifier
from aerojax.classify.card import TrainRotation
from aerojax.classify.load import load_classifier
from aerojax.core.files import write_json
from aerojax.data.clips import clip_files
from aerojax.data.splits import Split
from aerojax.data.windows import Windows, read_windows
from aerojax.evaluate.rotation_trials import Answers, RotationTrials, all_answers, figures_of, paired_figures
from aerojax.evaluate.rotations import protocols_of
from experiments._launch.command import Run, experiment
from experiments._launch.progress import progress_bar
from experiments._launch.rotation_screen import show_rotations

EXACT = (
    "exactly invariant: a rotation of a whole clip changes no answer and, in training, no loss beyond rounding, so "
    "none/none, z/z, z/SO3 and SO3/SO3 of one training are one number; z/SO3_pf turns each frame by itself"
)
"""What is said of the protocols of a classifier whose card says so."""


@dataclass(frozen=True, kw_only=True)
class Config(RotationTrials):
    """Which models on which clips.

    model: weights; the shipped ones if None. against: further weights to compare with on the same rotations.
    trained: rotation of the training clips; what the card says if None.
    clips: folders of `reconstruct_dataset` or `generate_clips`, one a rig; split: the one that is tested.
    validation: folders whose val/ the temperature is fitted on; empty takes those of `clips` that have one, and fits
        none where no folder has.
    frames: clips are cut to so many. window: frames of a window; as in training if None. stride: between windows.
    """

    preset: str
    model: Path | None = None
    against: Path | None = None
    trained: TrainRotation | None = None
    clips: tuple[Path, ...]
    validation: tuple[Path, ...] = ()
    split: Split = "test"
    frames: int = 32
    window: int | None = None
    stride: int = 2


def _windows(config: Config, classifier: Classifier, folders: tuple[Path, ...], split: str) -> Windows:
    length, tokens = config.window or classifier.card.frames, classifier.card.tokens * config.token_ensembles
    return read_windows(folders, split, frames=config.frames, length=length, stride=config.stride, tokens=tokens)


def _ask(config: Config, classifier: Classifier) -> tuple[Windows, Answers]:
    having_val = config.validation or tuple(folder for folder in config.clips if clip_files(folder / "val"))
    test = _windows(config, classifier, config.clips, config.split)
    val = _windows(config, classifier, having_val, "val") if having_val else None
    with progress_bar() as bar:
        task = bar.add_task("windows", total=None)

        def show(done: int, total: int, what: str) -> None:
            bar.update(task, completed=done, total=total, description=what)

        return test, all_answers(classifier, test, val, config, show)


def _measure(config: Config, path: Path | None) -> tuple[dict[str, Any], Windows, Answers]:
    classifier = load_classifier(path)
    test, answers = _ask(config, classifier)
    trained, exact = config.trained or classifier.card.rotation, classifier.card.rotation_invariant
    protocols = {p.name: p.test for p in protocols_of(trained, exactly_invariant=exact)}
    figures = {
        "model": str(path or classifier.card.name),
        "trained": trained,
        "exactly_invariant": exact,
        "note": EXACT if exact else "",
        "protocols": protocols,
    }
    return figures | figures_of(answers, test, config), test, answers


@experiment(Config, finished_by="results.json")
def main(config: Config, run: Run) -> None:
    """Write results.json and print a row a protocol."""
    console = Console()
    figures, test, answers = _measure(config, config.model)
    show_rotations(console, figures)
    sizes = {"windows": len(test.label), "videos": len(test.one_a_video()), "identities": len(set(test.identity))}
    results: dict[str, Any] = {**figures, **sizes, "seed": config.seed}
    if config.against is not None:
        other, other_test, other_answers = _measure(config, config.against)
        show_rotations(console, other)
        results["against"] = other
        results["paired_95"] = paired_figures((answers, test), (other_answers, other_test), config)
        for kind, row in results["paired_95"].items():
            low, high = 100 * row["low"], 100 * row["high"]
            console.print(f"{kind}: video accuracy less that of the other model {low:.1f} … {high:.1f}")
    write_json(run.directory / "results.json", {**results, **run.origin})
    console.print(str(run.directory / "results.json"), soft_wrap=True)


if __name__ == "__main__":
    main()
