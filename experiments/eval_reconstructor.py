"""Measure reconstructors by views that they were not given: one harness, a row a member, a column a condition."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import jax
from rich.console import Console

from aerojax.core.files import write_json
from aerojax.evaluate.perceptual import PerceptualConfig, load_perceptual
from aerojax.evaluate.reconstruction import FIGURES, binned, mean_figures
from aerojax.reconstruct.fit.optimise import GaussianFitConfig
from experiments._benchmarks.reconstruction_scenes import Condition, ConditionsConfig, conditions
from experiments._benchmarks.reconstruction_sheet import condition_table, write_sheet
from experiments._benchmarks.reconstructors import Entrant, cost_row, entrants, measured
from experiments._launch.command import Run, experiment
from experiments._launch.progress import progress_bar

WIDTHS_PX = (0.0, 8.0, 16.0, 32.0, 64.0, 128.0, 4096.0)
DISTANCES_M = (0.0, 4.0, 16.0, 64.0, 140.0, 400.0)
"""Edges of the bins of Figures 6.5 and 6.6."""


@dataclass(frozen=True, kw_only=True)
class Config:
    """Rows and columns.

    entrants: members of the door that need no file, by name, and `fit` for the per-object optimisation: a row each.
    weights: files of `train_reconstructor`, further rows by the names of their members.
    conditions: columns. fit: of the row `fit`. perceptual: a distance of images, if any.
    seed: of the recorded scenes and the fit. assets: where stages are built. pictures: scenes of a sheet.
    repeats: timed calls of a member.
    """

    preset: str
    seed: int = 0
    entrants: tuple[str, ...] = ("constant", "hull", "fit")
    weights: tuple[Path, ...] = ()
    conditions: ConditionsConfig = field(default_factory=ConditionsConfig)
    fit: GaussianFitConfig = field(default_factory=GaussianFitConfig)
    perceptual: PerceptualConfig = field(default_factory=PerceptualConfig)
    assets: Path = Path("data/assets")
    pictures: int = 8
    repeats: int = 10


def _measure(
    condition: Condition, everyone: tuple[Entrant, ...], config: Config, run: Run, show: Any
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Means and single scenes of one condition, for every row; a sheet of pictures where it is asked for."""
    scenes, perceptual = condition.scenes(), load_perceptual(config.perceptual)
    means, singles, pictures = [], [], {}
    head = {"factor": condition.factor, "value": condition.value}
    for entrant in everyone:
        rows, seen = measured(entrant, scenes, perceptual, show)
        named = {**head, "member": entrant.name}
        means.append(
            {**named, "scenes": len(rows), **mean_figures([{n: r[n] for n in FIGURES if n in r} for r in rows])}
        )
        singles += [{**named, **row} for row in rows]
        pictures[entrant.name] = seen
    if condition.sheet and config.pictures:
        name = condition.value.replace(" ", "_")
        write_sheet(run.directory / f"sheet_{name}.png", scenes, pictures, most=config.pictures)
    return means, singles


@experiment(Config, finished_by="results.json")
def main(config: Config, run: Run) -> None:
    """Print a table a condition; write results.json and sheets of pictures, targets beside renderings."""
    console, means, singles, costs = Console(), [], [], []
    everyone = entrants(config.entrants, config.weights, config.fit, seed=config.seed)
    with progress_bar() as bar:
        task = bar.add_task("reconstructions", total=None)
        for condition in conditions(config.conditions, config.assets, seed=config.seed):
            bar.update(task, description=f"{condition.factor} {condition.value}")
            rows, scenes = _measure(condition, everyone, config, run, lambda: bar.advance(task))
            means += rows
            singles += scenes
            bar.console.print(condition_table(f"{condition.factor}: {condition.value}", rows))
            if not costs:
                made, count = condition.scenes(), config.conditions.protocol.contexts
                costs = [cost_row(one, made, cameras=count, repeats=config.repeats) for one in everyone]
    recorded = [row for row in singles if row["factor"] in ("distance", "rig")]
    by = {
        one.name: {
            "width_px": binned([r for r in recorded if r["member"] == one.name], "width_px", WIDTHS_PX),
            "distance_m": binned([r for r in recorded if r["member"] == one.name], "distance_m", DISTANCES_M),
        }
        for one in everyone
    }
    notes = {"device": jax.devices()[0].device_kind, "seed": config.seed}
    results = {"rows": means, "cost": costs, "psnr_by": by, "perceptual": config.perceptual.name, "scenes": singles}
    write_json(run.directory / "results.json", {**results, **notes, **run.origin})
    console.print(str(run.directory / "results.json"), soft_wrap=True)


if __name__ == "__main__":
    main()
