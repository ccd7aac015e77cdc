"""Reconstruct the sequences of data sets and keep their decimated Gaussians as clips, the classifier's examples."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from rich.console import Console

from aerojax.core.files import write_json
from aerojax.pipeline.clips import ClipsConfig, make_clips
from aerojax.pipeline.config import PipelineConfig
from experiments._launch.command import Run, experiment
from experiments._launch.progress import progress_bar


@dataclass(frozen=True, kw_only=True)
class Config(ClipsConfig):
    """Which data sets, and where their clips go.

    datasets: folders of `generate_dataset`. folder: of the clips, one folder a rig in it.
    pipeline: from images to Gaussians. workers: processes.
    only: patterns of sequence names: `only=[sim1_*_r016_*,sim2_*]`.
    """

    preset: str
    seed: int = 0
    tokens: int = 512
    pipeline: PipelineConfig = field(default_factory=PipelineConfig)
    datasets: tuple[Path, ...]
    only: tuple[str, ...] = ("*",)
    folder: Path
    workers: int = 2


@experiment(Config)
def main(config: Config, run: Run) -> None:
    """Make the clips that are missing and say where they are."""
    plain = ClipsConfig(config.seed, config.tokens, config.pipeline)
    with progress_bar("clips/s") as bar:
        task = bar.add_task(f"clips in {config.folder}")
        made = make_clips(
            plain,
            config.datasets,
            config.folder,
            only=config.only,
            workers=config.workers,
            progress=lambda done, total, what: bar.update(task, completed=done, total=total),
        )
    if made.unusable:
        Console(stderr=True).print(
            f"{len(made.unusable)} sequences left no clip: no camera shows the whole object, or those that do disagree"
        )
    results = {"folder": str(config.folder), "clips": made.counts, "unusable": list(made.unusable)}
    write_json(run.directory / "metrics.json", results)
    Console().print(f"{config.folder}: {made.counts}")


if __name__ == "__main__":
    main()
