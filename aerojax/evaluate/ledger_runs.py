"""The commands whose results the ledger stands on, in an order in which each finds what it needs, and which are due."""

from __future__ import annotations

import json
import shlex
import shutil
import tomllib
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

from aerojax.core.config import to_dataclass
from aerojax.core.errors import UserError
from aerojax.core.files import whole_file, write_json

RUNS = "ledger_runs.toml"
DONE = "done.json"
"""Where a run's folder says with which command it ended."""


@dataclass(frozen=True, kw_only=True)
class Step:
    """One command.

    name: of the step, of its folder, and of its file in results/ with `leaves`.
    command: the act with its overrides, `{preset}` for the preset and `{folder}` for the folder of all steps' runs.
    sweep: it is a sweep of several runs.
    leaves: the file in its folder that becomes a file of results/; empty for acts that make data or weights.
    presets: in which it is run. minutes: of two processor cores with the preset small, about.
    """

    name: str
    command: str
    sweep: bool = False
    leaves: str = ""
    presets: tuple[str, ...] = ("smoke", "small", "full")
    minutes: float = 1.0

    def arguments(self, preset: str, folder: Path) -> list[str]:
        """Words behind `python -m`, with the folder that the run leaves its files in."""
        act, *overrides = shlex.split(self.command.format(preset=preset, folder=folder))
        where = f"hydra.{'sweep' if self.sweep else 'run'}.dir={folder / self.name}"
        return [f"experiments.{act}", f"preset={preset}", *overrides, where]


def read_steps(preset: str) -> tuple[Step, ...]:
    """The steps of a preset, in order.

    Raises:
        UserError: a step has an unknown key or a value of another type.
    """
    text = (files("aerojax.evaluate") / RUNS).read_text(encoding="utf-8")
    steps = (to_dataclass(row, Step, source=RUNS) for row in tomllib.loads(text)["step"])
    return tuple(step for step in steps if preset in step.presets)


def command_of(name: str, preset: str = "small") -> str | None:
    """The command line that makes a file of results, None if no step does; runs of other steps stand for `FOLDER`."""
    found = [step for step in read_steps(preset) if step.name == name and step.leaves]
    if not found:
        return None
    return "python -m experiments." + found[0].command.format(preset=preset, folder="FOLDER")


def is_done(step: Step, preset: str, folder: Path) -> bool:
    """Whether a step has ended in this folder with the command that it has now."""
    path = folder / step.name / DONE
    return path.is_file() and json.loads(path.read_text(encoding="utf-8")) == step.arguments(preset, folder)


def finish(step: Step, preset: str, folder: Path, results: Path) -> None:
    """Take a step's file over into `results`, where it is named after the step, and note that it is done.

    Raises:
        UserError: the step has not left its file.
    """
    if step.leaves:
        left = folder / step.name / step.leaves
        if not left.is_file():
            raise UserError("missing", f"{left}: the command ended without it", "see what it printed")
        with whole_file(results / f"{step.name}.json") as temporary:
            shutil.copyfile(left, temporary)
    write_json(folder / step.name / DONE, step.arguments(preset, folder))
