"""Kill the acts at random moments, fill their disk and forbid them to write: each must go on to the same bytes."""

from __future__ import annotations

import itertools
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from aerojax.core.errors import UserError
from aerojax.core.files import write_json
from aerojax.core.provenance import commit
from aerojax.evaluate.kills.outputs import FOREIGN, UNFINISHED, VOLATILE
from aerojax.evaluate.kills.trials import try_target
from experiments._kills.acts import ACTS, IGNORED, ROOT, make_inputs, targets
from experiments._kills.rows import earlier_rows, summary
from experiments._launch.command import Run, experiment
from experiments._launch.progress import progress_bar

LEFT_OUT = {"keys": sorted(VOLATILE), "names": [*UNFINISHED, *FOREIGN, *IGNORED, "*table.md"]}
"""What need not be the same after a kill: times and what Hydra and orbax keep for themselves."""


@dataclass(frozen=True, kw_only=True)
class Config:
    """How often.

    kills: that must meet a running act, of all acts together.
    seed: of the moments.
    only: names of acts; all if empty.
    """

    preset: str
    kills: int = 100
    seed: int = 0
    only: tuple[str, ...] = ()


def measure(config: Config, folder: Path, rows: dict[str, dict[str, Any]]) -> Iterator[dict[str, dict[str, Any]]]:
    """The rows after each act; they share the kills as evenly as may be. Acts that have a row are not killed again."""
    cache = {"JAX_COMPILATION_CACHE_DIR": str(folder / "cache"), "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0.2"}
    environment = {**cache, "JAX_PLATFORMS": "cpu"}
    chosen = config.only or ACTS
    make_inputs(folder / "inputs", environment, [name for name in chosen if name not in rows])
    known = targets(folder / "inputs")
    with progress_bar() as bar:
        for number, name in enumerate(chosen):
            share = config.kills // len(chosen) + (number < config.kills % len(chosen))
            task = bar.add_task(name, total=share)
            if name in rows:
                continue
            row = try_target(
                known[name],
                name,
                folder / f"act_{number}",
                root=ROOT,
                environment=environment,
                kills=share,
                seed=config.seed,
                progress=lambda done, total, what, task=task: bar.update(task, completed=done),
            )
            rows = {**rows, name: {"act": name, **asdict(row), "commit": commit()}}
            yield rows


def show(acts: Sequence[Mapping[str, Any]], console: Console) -> None:
    """A row an act, and what was wrong."""
    table = Table("act", "s", "kills", "runs", "equal", "failures")
    for row in acts:
        counts = (str(row[name]) for name in ("kills", "runs", "byte_equal"))
        table.add_row(row["act"], f"{row['seconds']:.1f}", *counts, str(len(row["failures"])))
    console.print(table)
    for row in acts:
        for failure in row["failures"]:
            console.print(f"{row['act']}: {failure}", markup=False, soft_wrap=True)


@experiment(Config)
def main(config: Config, run: Run) -> None:
    """Write results.json after each act, and go on from it; code 1 if an act left something else than it should."""
    if unknown := sorted(set(config.only) - set(ACTS)):
        raise UserError("out-of-range", f"only={unknown} are no acts", f"known are {', '.join(ACTS)}")
    rows = earlier_rows(run.directory / "results.json", config.only or ACTS, config.seed)
    results = summary(rows)
    with tempfile.TemporaryDirectory() as folder:
        for reached in itertools.chain([rows], measure(config, Path(folder), rows)):
            results = summary(reached)
            notes = {"left_out": LEFT_OUT, "seed": config.seed, **run.origin}
            notes["date"] = datetime.now(UTC).isoformat(timespec="seconds")
            write_json(run.directory / "results.json", {**results, **notes})
    console = Console()
    show(results["acts"], console)
    kills, equal, failures = (results[name] for name in ("kills", "byte_equal", "failures"))
    console.print(
        f"{equal} of {kills} kills ended with the same bytes: {run.directory / 'results.json'}", soft_wrap=True
    )
    if failures or equal < kills:
        sys.exit(1)


if __name__ == "__main__":
    main()
