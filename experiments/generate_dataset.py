"""Generate the data set: sequences of the 91 identities before the thesis' camera networks, with exact truth."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from aerojax.core.config import part_of, to_mapping
from aerojax.core.files import write_json
from aerojax.data.manifest import ENTRY
from aerojax.simulate.generate import GenerationResult, Shard, generate_dataset
from aerojax.simulate.plan.dataset import DatasetConfig, SequenceTask, count, work_list
from aerojax.simulate.plan.sizes import estimated_bytes
from experiments._launch.command import Run, experiment
from experiments._launch.progress import progress_bar, shown_in


@dataclass(frozen=True, kw_only=True)
class Config(DatasetConfig):
    """A data set, where it is made, and how.

    folder: of the data set; several rigs may share it.
    workers: processes. shard, shards: this process's share of the sequences.
    dry_run: only list the work. overwrite: make this rig's sequences again.
    """

    preset: str
    folder: Path
    workers: int = 2
    shard: int = 0
    shards: int = 1
    dry_run: bool = False
    overwrite: bool = False


@experiment(Config)
def main(config: Config, run: Run) -> None:
    """List the work, or do it and say how fast it was."""
    console = Console(soft_wrap=True)
    tasks = work_list(config)
    counts = count(config, tasks)
    metrics = {"folder": str(config.folder), **to_mapping(counts), "estimated_bytes": estimated_bytes(config, tasks)}
    if config.dry_run:
        list_work(config, tasks, console)
        write_json(run.directory / "metrics.json", metrics)
        return
    shard = Shard(config.shard, config.shards)
    with progress_bar("/s") as bar:
        result = generate_dataset(
            part_of(config, DatasetConfig),
            config.folder,
            workers=config.workers,
            shard=shard,
            progress=shown_in(bar),
            overwrite=config.overwrite,
        )
    write_json(run.directory / "metrics.json", {**metrics, **summary(result)})
    console.print(summary_line(config.folder, result))


def list_work(config: Config, tasks: tuple[SequenceTask, ...], console: Console) -> None:
    """Print every sequence with whether it is there already, and the totals."""
    for task in tasks[config.shard :: config.shards]:
        there = (config.folder / task.folder / ENTRY).is_file()
        console.print(f"{'done' if there else 'todo'} {task.folder}", highlight=False)
    counts, size = count(config, tasks), estimated_bytes(config, tasks) / 1e9
    console.print(
        f"{config.folder}: {counts.identities} identities, {counts.sequences} sequences, {counts.frames} frames, "
        f"{counts.images} images, about {size:.2f} GB"
    )


def summary(result: GenerationResult) -> dict[str, float | int | bool]:
    """Figures of a run: rate, and shares of the workers' time."""
    timings = result.timings
    spent = max(timings.simulate + timings.cast + timings.write, 1e-9)
    shares = {key: round(getattr(timings, key) / spent, 3) for key in ("simulate", "cast", "write")}
    rate = round(timings.images / max(result.seconds, 1e-9), 2)
    return {
        "made": result.sequences,
        "images_written": timings.images,
        "images_per_s": rate,
        **shares,
        "complete": result.complete,
    }


def summary_line(folder: Path, result: GenerationResult) -> str:
    """One line for people."""
    facts = summary(result)
    state = "complete" if result.complete else "other shards are still missing"
    split = ", ".join(f"{key} {100 * float(facts[key]):.0f} %" for key in ("simulate", "cast", "write"))
    rate = f"{facts['images_written']} images, {facts['images_per_s']} images/s ({split})"
    return f"{folder}: {result.sequences} sequences made, {rate}; {state}"


if __name__ == "__main__":
    main()
