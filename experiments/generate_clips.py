"""Simulate sequences of held-apart identities, reconstruct them and keep their decimated Gaussians as clips."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from experiments.clip_factory import ClipsConfig, ensure_clips
from experiments.launch import Run, experiment, write_json


@dataclass(frozen=True)
class Config(ClipsConfig):
    """A set of clips and where it is made."""

    preset: str
    folder: Path
    assets: Path
    workers: int


@experiment(Config)
def main(config: Config, run: Run) -> None:
    """Make the clips and say where they are."""
    folder = ensure_clips(config, folder=config.folder, assets=config.assets, workers=config.workers)
    counts = {split: len(list((folder / split).glob("*.npz"))) for split in config.splits}
    write_json(run.directory / "metrics.json", {"folder": str(folder), "clips": counts})
    Console().print(f"{folder}: {counts}")


if __name__ == "__main__":
    main()
