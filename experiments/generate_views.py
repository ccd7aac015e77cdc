"""Make scenes for training reconstructors: crops of flyers and of solids of no class, and target views of each."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from aerojax.core.config import part_of
from aerojax.core.files import write_json
from aerojax.core.provenance import provenance
from aerojax.pipeline.factory.views import ViewsConfig
from aerojax.pipeline.factory.write_views import make_views
from experiments._launch.command import Run, experiment
from experiments._launch.progress import progress_bar, shown_in


@dataclass(frozen=True, kw_only=True)
class Config(ViewsConfig):
    """What is made, and where.

    folder: of the scenes; other splits, and more objects, may be added to it.
    workers: processes.
    """

    preset: str
    folder: Path
    workers: int = 2


@experiment(Config)
def main(config: Config, run: Run) -> None:
    """Make the shards that are missing; say how many scenes there are and how fast it was."""
    plain = part_of(config, ViewsConfig)
    begin = time.perf_counter()
    with progress_bar("objects/s") as bar:
        made = make_views(plain, config.folder, workers=config.workers, progress=shown_in(bar))
    seconds = time.perf_counter() - begin
    results = {"folder": str(config.folder), "split": config.split, "objects": made.objects, "new_scenes": made.new}
    write_json(run.directory / "metrics.json", {**results, "seconds": seconds, **provenance(run.overrides)})
    rate = made.new / max(seconds, 1e-9)
    Console().print(f"{config.folder}/{config.split}: {made.new} new scenes, {rate:.2f} a second", soft_wrap=True)


if __name__ == "__main__":
    main()
