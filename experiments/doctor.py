"""Say what this machine can do: versions, devices, kernels, codecs, caches; what is broken ends it with code 1."""

from __future__ import annotations

import dataclasses
import sys
from dataclasses import dataclass

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from aerojax.core.files import write_json
from experiments._doctor.checks import findings
from experiments._launch.command import Run, experiment

_MARKS = {"ok": "[green]✓[/green]", "absent": "[yellow]–[/yellow]", "broken": "[red]✗[/red]"}


@dataclass(frozen=True, kw_only=True)
class Config:
    """Nothing can be chosen."""

    preset: str


@experiment(Config)
def main(config: Config, run: Run) -> None:
    """Table, and doctor.json, which belongs to a report of a fault."""
    console, found = Console(), []
    table = Table("", "part", "found", box=None, pad_edge=False)
    for one in findings():
        found.append(one)
        remedy = f"; {one.remedy}" if one.remedy else ""
        table.add_row(_MARKS[one.state], one.part, escape(one.text + remedy))
    console.print(table)
    path = run.directory / "doctor.json"
    write_json(path, [dataclasses.asdict(one) for one in found])
    console.print(str(path), soft_wrap=True)
    if any(one.state == "broken" for one in found):
        sys.exit(1)


if __name__ == "__main__":
    main()
