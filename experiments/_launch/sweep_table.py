"""Hydra's callback that keeps the table of a comparison's sweep up to date."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from hydra.experimental.callback import Callback
from hydra.types import RunMode
from omegaconf import DictConfig
from rich.console import Console

from aerojax.core.files import write_text
from aerojax.core.provenance import command_line
from aerojax.evaluate.comparison import write_table
from aerojax.view.comparison import comparison_svg


class SweepTable(Callback):
    """Writes the table of a sweep's directory, run by run."""

    def on_job_end(self, config: DictConfig, job_return: Any, **kwargs: Any) -> None:
        """After each run of a sweep."""
        if config.hydra.mode == RunMode.MULTIRUN:
            write_table(Path(config.hydra.sweep.dir), _command(config))

    def on_multirun_end(self, config: DictConfig, **kwargs: Any) -> None:
        """After the last run, also where all were finished before."""
        folder = Path(config.hydra.sweep.dir)
        console = Console()
        console.print(write_table(folder, _command(config)), markup=False, soft_wrap=True)
        console.print(str(folder / "table.md"), soft_wrap=True)
        rows = json.loads(path.read_text())["rows"] if (path := folder / "table.json").is_file() else []
        if rows and "tests" in rows[0]:
            write_text(folder / "table.svg", comparison_svg(rows))


def _command(config: DictConfig) -> str:
    """The command line of a sweep, or of one of its runs."""
    return command_line(config.hydra.job.name, config.hydra.overrides.task)
