"""Reconstruct the sequences of data sets and keep their decimated Gaussians as clips, the classifier's examples."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from aerojax.pipeline.clips import ClipsConfig, make_clips
from experiments._launch.command import Run, experiment, write_json


@dataclass(frozen=True, kw_only=True)
class Config(ClipsConfig):
    """Which data sets (`only` those sequences whose names match a pattern), and where their clips go."""

    preset: str
    datasets: tuple[Path, ...]
    only: tuple[str, ...]
    folder: Path
    workers: int


@experiment(Config)
def main(config: Config, run: Run) -> None:
    """Make the clips that are missing and say where they are."""
    plain = ClipsConfig(config.seed, config.tokens, config.pipeline)
    counts = make_clips(plain, config.datasets, config.folder, only=config.only, workers=config.workers)
    write_json(run.directory / "metrics.json", {"folder": str(config.folder), "clips": counts})
    Console().print(f"{config.folder}: {counts}")


if __name__ == "__main__":
    main()
