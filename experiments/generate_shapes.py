"""Make shapes-10: upright things of ten kinds as Gaussians of their surfaces, in clips of single frames."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from aerojax.core.config import part_of
from aerojax.core.files import write_json
from aerojax.simulate.assets.shapes.clips import ShapesConfig, make_shapes
from experiments._launch.command import Run, experiment
from experiments._launch.progress import progress_bar, shown_in


@dataclass(frozen=True, kw_only=True)
class Config(ShapesConfig):
    """What is made, and where.

    folder: of the clips.
    """

    preset: str
    folder: Path


@experiment(Config)
def main(config: Config, run: Run) -> None:
    """Make the clips that are missing."""
    with progress_bar("clips/s") as bar:
        counts = make_shapes(part_of(config, ShapesConfig), config.folder, progress=shown_in(bar))
    write_json(run.directory / "metrics.json", {"folder": str(config.folder), "clips": counts})
    Console().print(f"{config.folder}: {counts}", soft_wrap=True)


if __name__ == "__main__":
    main()
