"""Measure what classifying costs: every member a frame beside its accuracy, and MambaSplat's modes by size of clip."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import jax
import jax.numpy as jnp
from rich.console import Console
from rich.table import Table

from aerojax.classify.mambasplat.config import MambaSplatConfig, Mode, published_config
from aerojax.classify.mambasplat.cost import operations, parameter_count, unused_bridge_parameters
from aerojax.classify.mambasplat.model import MambaSplat
from aerojax.classify.members import MEMBERS
from aerojax.core.files import write_json
from aerojax.pipeline.config import PipelineConfig
from aerojax.pipeline.cost import program_cost, random_tokens
from experiments._benchmarks.members import chosen_members, member_row, member_table
from experiments._launch.command import Run, experiment
from experiments._launch.progress import progress_bar


@dataclass(frozen=True)
class Size:
    """Frames of a clip and tokens of a frame."""

    frames: int
    tokens: int


@dataclass(frozen=True, kw_only=True)
class Config:
    """What is measured; figures are medians of `repeats` calls after one.

    weights: trained members to measure after the shipped one; their accuracy is what their cards say.
    untrained: members to measure with random weights, which cost the same, by name.
    views: cameras before the members. pipeline: what their stage is given.
    variant, mode, sizes: of MambaSplat, each with each.
    repeats: calls, of which the median counts.
    """

    preset: str
    seed: int = 0
    weights: tuple[Path, ...] = ()
    untrained: tuple[str, ...] = tuple(MEMBERS)
    views: int = 4
    pipeline: PipelineConfig = field(default_factory=PipelineConfig)
    variant: tuple[Literal["exact", "published"], ...] = ("exact", "published")
    mode: tuple[Mode, ...] = ("C", "X")
    sizes: tuple[Size, ...] = (Size(8, 96), Size(16, 128))
    repeats: int = 30


def _row(config: Config, made: MambaSplatConfig, size: Size) -> dict[str, Any]:
    model = MambaSplat(made, key=jax.random.key(config.seed))
    count, unused = parameter_count(made), unused_bridge_parameters(made)
    sizes = {"variant": made.variant, "mode": made.mode, "frames": size.frames, "tokens": size.tokens}
    counts = {"parameters": count, "parameters_with_unused_bridge": count + unused}
    counts |= {"gflop": operations(made, size.frames, size.tokens) / 1e9}
    arguments = random_tokens(size.frames, size.tokens, seed=config.seed), jnp.ones((size.frames, size.tokens), bool)
    return {**sizes, **counts, **program_cost(MambaSplat.__call__, (model, *arguments), repeats=config.repeats)}


@experiment(Config, finished_by="results.json")
def main(config: Config, run: Run) -> None:
    """Write results.json and print a row a member, and one a variant, mode and size of MambaSplat."""
    table = Table("variant", "mode", "T", "N", "parameters", "GFLOP", "ms", "GFLOP/s", "working MB", "peak MB")
    made = [
        (MambaSplatConfig if v == "exact" else published_config)(mode=m) for v in config.variant for m in config.mode
    ]
    console, rows, members = Console(), [], []
    with progress_bar() as bar:
        chosen = chosen_members(config.weights, config.untrained, seed=config.seed)
        for name, classifier in bar.track(chosen.items(), description="members"):
            about = {"views": config.views, "repeats": config.repeats, "seed": config.seed}
            members.append(member_row(name, classifier, config.pipeline, **about))
        for one, size in bar.track([(m, s) for m in made for s in config.sizes], description="settings"):
            row = _row(config, one, size)
            rows.append(row)
            figures = row["gflop"], row["latency_ms"], 1e3 * row["gflop"] / row["latency_ms"]
            memory = "-" if row["working_mb"] is None else f"{row['working_mb']:.1f}", f"{row['process_peak_mb']:.0f}"
            named = (row["variant"], row["mode"], str(size.frames), str(size.tokens), f"{row['parameters']:,}")
            table.add_row(*named, *(f"{f:.2f}" for f in figures), *memory)
    console.print(member_table(members))
    console.print(table)
    notes = {"device": jax.devices()[0].device_kind, **run.origin}
    write_json(run.directory / "results.json", {"members": members, "rows": rows, **notes})
    console.print(str(run.directory / "results.json"), soft_wrap=True)


if __name__ == "__main__":
    main()
