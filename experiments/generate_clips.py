"""Make clips for classifiers straight from simulated flights: any number, any cameras, no pictures on the way."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from aerojax.core.config import part_of
from aerojax.core.files import write_json
from aerojax.pipeline.factory.config import FactoryConfig
from aerojax.pipeline.factory.write import make_factory_clips
from experiments._launch.command import Run, experiment
from experiments._launch.progress import progress_bar, shown_in


@dataclass(frozen=True, kw_only=True)
class Config(FactoryConfig):
    """What is made, and where: 4 · individuals · clips of them.

    folder: of the clips; other splits, and more individuals or clips, may be added to it.
    workers: processes.
    """

    preset: str
    folder: Path
    workers: int = 2


@experiment(Config)
def main(config: Config, run: Run) -> None:
    """Make the clips that are missing; say how many there are and how fast it was."""
    plain = part_of(config, FactoryConfig)
    begin = time.perf_counter()
    with progress_bar("clips/s") as bar:
        made = make_factory_clips(plain, config.folder, workers=config.workers, progress=shown_in(bar))
    seconds = time.perf_counter() - begin
    if made.unusable:
        Console(stderr=True).print(f"{len(made.unusable)} clips given up: seldom seen whole by enough cameras")
    rate = round(made.new / max(seconds, 1e-9), 2)
    results = {"folder": str(config.folder), "clips": made.counts, "new": made.new, "clips_per_s": rate}
    write_json(run.directory / "metrics.json", {**results, "seconds": seconds, "unusable": list(made.unusable)})
    Console().print(f"{config.folder}: {made.counts}; {made.new} new, {rate} clips/s", soft_wrap=True)


if __name__ == "__main__":
    main()
