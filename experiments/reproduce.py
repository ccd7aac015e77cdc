"""The thesis' claims beside what is measured here: writes the ledger; `run=true` measures, resumable."""

from __future__ import annotations

import subprocess
import sys
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from aerojax.core.errors import UserError
from aerojax.core.files import write_json, write_text
from aerojax.evaluate.ledger import VERDICTS, ledger_of
from aerojax.evaluate.ledger_page import ledger_markdown
from aerojax.evaluate.ledger_runs import Step, finish, is_done, read_steps
from experiments._launch.command import Run, experiment


@dataclass(frozen=True, kw_only=True)
class Config:
    """Which results become which page, and whether they are measured first.

    run: run every command whose result is missing or was made by another command, one after the other; ended ones
        are skipped, so that it may be stopped at any time and started again.
    only: names of steps that are run; all if empty. missing: only those whose file of results is not there.
    folder: of the commands' runs. results: of the files that the ledger is made from, and new ones are copied to.
    page: which is written.
    """

    preset: str
    run: bool = False
    only: tuple[str, ...] = ()
    missing: bool = False
    folder: Path
    results: Path = Path("results")
    page: Path = Path("docs/ledger.md")


def _steps(config: Config) -> list[Step]:
    steps = read_steps(config.preset)
    unknown = sorted(set(config.only) - {step.name for step in steps})
    if unknown:
        known = ", ".join(step.name for step in steps)
        raise UserError("missing", f"there is no step {', '.join(unknown)}", f"name some of: {known}")
    chosen = [step for step in steps if not config.only or step.name in config.only]
    return [step for step in chosen if not config.missing or not (config.results / f"{step.name}.json").is_file()]


def _run(steps: list[Step], config: Config, console: Console) -> None:
    """Run what is not done yet; a command that fails ends it."""
    for number, step in enumerate(steps, 1):
        told = f"{number} of {len(steps)}: {step.name}"
        if is_done(step, config.preset, config.folder):
            console.print(f"{told}: done before", soft_wrap=True)
            continue
        console.print(f"{told}, about {step.minutes:g} minutes with preset=small", soft_wrap=True)
        command = [sys.executable, "-m", *step.arguments(config.preset, config.folder)]
        if code := subprocess.run(command, check=False).returncode:
            raise UserError(
                "invalid", f"{step.name} ended with code {code}", "mend it and start again; it goes on here"
            )
        finish(step, config.preset, config.folder, config.results)


@experiment(Config)
def main(config: Config, run: Run) -> None:
    """Write the page, and how many claims have which verdict to results.json and the screen."""
    console = Console()
    if config.run:
        _run(_steps(config), config, console)
    entries = ledger_of(config.results)
    write_text(config.page, ledger_markdown(entries, config.results))
    counts = Counter(entry.verdict for entry in entries)
    found = {"verdicts": {name: counts[name] for name in VERDICTS}}
    write_json(run.directory / "results.json", {**found, **run.origin})
    console.print(", ".join(f"{counts[name]} {name}" for name in VERDICTS), soft_wrap=True)
    console.print(str(config.page), soft_wrap=True)


if __name__ == "__main__":
    main()
