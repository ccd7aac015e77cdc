"""Export a data set to COCO, YOLO, MOTChallenge, COLMAP, nerfstudio or Isaac Replicator."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from rich.console import Console

from aerojax.core.files import write_json
from aerojax.data.exports.export import chosen_formats, export_dataset, find_notices
from aerojax.data.exports.sources import ExportOptions, Placement, ReplicatorLayout, find_sequences
from experiments._launch.command import Run, experiment
from experiments._launch.progress import progress_bar


@dataclass(frozen=True, kw_only=True)
class Config:
    """What to export, to which formats and where.

    dataset: a generated data set, a folder of captures or one capture.
    format: names of `FORMATS`.
    out: folder of the exports.
    images: how they get there; undistorted ones are written anew.
    depth: write depth maps where format and capture have them.
    replicator_layout: flat has all files of a camera in one folder.
    workers: processes. overwrite: make again what is there.
    """

    preset: str
    dataset: Path = field(metadata={"given": True})
    format: tuple[str, ...]
    out: Path
    images: Placement = "copy"
    depth: bool = True
    replicator_layout: ReplicatorLayout = "nested"
    workers: int = 2
    overwrite: bool = False


@experiment(Config)
def main(config: Config, run: Run) -> None:
    """A folder of captures in, `out/<format>` out."""
    formats = chosen_formats(config.format)
    sequences = find_sequences(config.dataset)
    options = ExportOptions(config.images, config.depth, config.replicator_layout)
    done = {}
    with progress_bar() as bar:
        for name in formats:
            task = bar.add_task(name, total=len(sequences))
            folder = export_dataset(
                sequences,
                name,
                config.out,
                options,
                workers=config.workers,
                overwrite=config.overwrite,
                notices=find_notices(config.dataset),
                progress=lambda done, total, what, task=task: bar.update(task, completed=done),
            )
            done[name] = str(folder)
    write_json(run.directory / "metrics.json", {"sequences": len(sequences), "exports": done})
    Console().print(f"{len(sequences)} sequences: {', '.join(done.values())}")


if __name__ == "__main__":
    main()
