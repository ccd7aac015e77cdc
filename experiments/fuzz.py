"""Read thousands of damaged files of every format: none may end in anything but an answer or a refusal by name."""

from __future__ import annotations

import sys
import tempfile
from dataclasses import asdict, dataclass, field
from pathlib import Path

from rich.console import Console
from rich.table import Table

from aerojax.core.errors import UserError
from aerojax.core.files import write_bytes, write_json
from aerojax.evaluate.fuzz.campaign import fuzz
from aerojax.evaluate.fuzz.workers import Limits, Tally, changed_files, run_case
from experiments._fuzz.targets import TARGETS, make_targets
from experiments._launch.command import Run, experiment
from experiments._launch.progress import progress_bar


@dataclass(frozen=True, kw_only=True)
class Config:
    """How long, and what.

    seconds: of reading, after the processes have started.
    seed: of the changes. only: formats; all if empty.
    case: read this one case of the one format in `only` and say how it ended; its files are left in the run's folder.
    workers: processes. limits: of one case.
    """

    preset: str
    seed: int = 0
    seconds: float = 600.0
    only: tuple[str, ...] = ()
    case: int | None = None
    workers: int = 2
    limits: Limits = field(default_factory=Limits)


def repeat(config: Config, name: str, case: int, run: Run) -> None:
    """Read one case in this process."""
    target = make_targets([name])[name]
    files = changed_files(target, name, config.seed, case)
    for path, content in files.items():
        write_bytes(run.directory / "case" / path, content)
    kind, where = run_case(target, files, run.directory / "read")
    Console().print(f"{name} case {case} of seed {config.seed}: {kind}\n{where}", markup=False)


def show(tally: Tally, console: Console) -> None:
    """Counts by format, and how to repeat each finding."""
    table = Table("format", "read", "refused", "findings")
    for name in sorted({*tally.read, *tally.refused, *tally.found}):
        table.add_row(name, str(tally.read[name]), str(tally.refused[name]), str(tally.found[name]))
    console.print(table)
    for found in tally.findings.values():
        console.print(f"{found.kind}: only=[{found.format}] case={found.case}\n{found.where}", markup=False)


@experiment(Config)
def main(config: Config, run: Run) -> None:
    """Counts and findings in metrics.json out; code 1 if there is a finding."""
    if unknown := sorted(set(config.only) - TARGETS.keys()):
        raise UserError("out-of-range", f"only={unknown} are no formats", f"known are {', '.join(TARGETS)}")
    names = config.only or tuple(TARGETS)
    if config.case is not None:
        if len(names) != 1:
            raise UserError("out-of-range", "case= is the number of a case of one format", "set only=[ply] or another")
        return repeat(config, names[0], config.case, run)
    with progress_bar() as bar, tempfile.TemporaryDirectory() as folder:
        task = bar.add_task("fuzz", total=int(config.seconds))
        tally = fuzz(
            make_targets(names),
            Path(folder),
            seconds=config.seconds,
            seed=config.seed,
            workers=config.workers,
            limits=config.limits,
            progress=lambda done, total, what: bar.update(task, completed=done, description=what),
        )
    counts = {name: dict(sorted(getattr(tally, name).items())) for name in ("read", "refused", "found")}
    results = {
        "inputs": tally.inputs,
        "workers": config.workers,
        "seconds": config.seconds,
        "seed": config.seed,
        **counts,
    }
    results |= {"limits": asdict(config.limits), "findings": [asdict(found) for found in tally.findings.values()]}
    write_json(run.directory / "metrics.json", {**results, **run.origin})
    console = Console()
    show(tally, console)
    console.print(f"{tally.inputs} inputs, {len(tally.findings)} findings: {run.directory / 'metrics.json'}")
    if tally.findings:
        sys.exit(1)


if __name__ == "__main__":
    main()
