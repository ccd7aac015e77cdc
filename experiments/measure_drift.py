"""Measure how far logits drift under rotation, and under another quaternion of the same ellipsoid."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import jax
from rich.console import Console
from rich.table import Table

from aerojax.classify.base import Trainable, untrained
from aerojax.classify.load import load_classifier
from aerojax.classify.mambasplat.config import MambaSplatConfig, Mode, published_config
from aerojax.core.files import write_json
from aerojax.data.splits import Split
from aerojax.data.windows import Windows, read_windows
from aerojax.evaluate.drift_passes import relabelling_drift, rotation_drift
from experiments._launch.command import Run, experiment
from experiments._launch.progress import progress_bar


@dataclass(frozen=True, kw_only=True)
class Config:
    """Which models, which clips, how many rotations.

    model: weights, one file or several (as of several seeds); the shipped ones if there are neither these nor modes.
    mode: modes of untrained models to measure besides. variant, lifting: of these. seeds: one such model for each.
    clips: folders of `reconstruct_dataset`. split: of theirs. count: clips that are used, each by its first window.
    frames, tokens: of a window.
    rotations: of every clip in single precision; double: in double precision.
    """

    preset: str
    seed: int = 0
    model: tuple[Path, ...] = ()
    mode: tuple[Mode, ...] = ()
    variant: Literal["exact", "published"] = "exact"
    lifting: Literal["covariance", "columns"] = "covariance"
    seeds: tuple[int, ...] = (0, 1, 2)
    clips: tuple[Path, ...]
    split: Split = "test"
    count: int = 32
    frames: int = 8
    tokens: int = 96
    rotations: int = 100
    double: int = 4


def _models(config: Config) -> dict[str, Trainable]:
    models = {str(path): load_classifier(path) for path in config.model}
    if not models and not config.mode:
        shipped = load_classifier(Path("mambasplat"))
        models = {shipped.card.name: shipped}
    for mode in config.mode:
        exact = config.variant == "exact"
        made = MambaSplatConfig(mode=mode, lifting=config.lifting) if exact else published_config(mode)
        for seed in config.seeds:
            key = jax.random.key(seed)
            models[f"untrained {mode} {seed}"] = untrained(made, tokens=config.tokens, frames=config.frames, key=key)
    return models


def _clips(config: Config) -> Windows:
    sizes = {"frames": config.frames, "length": config.frames, "stride": config.frames, "tokens": config.tokens}
    return read_windows(config.clips, config.split, **sizes).spread(config.count)


def _measure(model: Trainable, windows: Windows, config: Config) -> dict[str, Any]:
    made = dict(model.card.config)
    kind = {name: made[name] for name in ("mode", "variant", "lifting")}
    rotation = rotation_drift(model, windows, config.rotations, seed=config.seed)
    double = rotation_drift(model, windows, config.double, seed=config.seed, double=True)
    relabelling = relabelling_drift(model, windows, seed=config.seed)
    return {**kind, "rotation": rotation, "rotation_double": double, "relabelling": relabelling}


def _table(results: dict[str, dict[str, Any]]) -> Table:
    table = Table(
        "model", "mode", "Δ_max", "floor", "of std", "m_min", "flips", "verdict", "Δ f64", "Δ other q", "flips"
    )
    for name, row in results.items():
        turn, other = row["rotation"], row["relabelling"]
        relative = turn["relative_drift"]
        table.add_row(
            Path(name).name,
            row["mode"],
            f"{turn['largest_drift']:.1e}",
            f"{turn['noise_floor']:.1e}",
            "-" if relative is None else f"{relative:.1e}",
            f"{turn['smallest_margin']:.2g}",
            f"{turn['flips']}/{turn['passes']}",
            turn["verdict"] + (", guaranteed" if turn["guaranteed"] else ""),
            f"{row['rotation_double']['largest_drift']:.1e}",
            f"{other['largest_drift']:.1e}",
            f"{other['flips']}/{other['passes']}",
        )
    return table


@experiment(Config, finished_by="results.json")
def main(config: Config, run: Run) -> None:
    """Write results.json and print a row a model."""
    console, windows, results = Console(), _clips(config), {}
    with progress_bar() as bar:
        for name, model in bar.track(_models(config).items(), description=f"{len(windows.label)} clips"):
            results[name] = _measure(model, windows, config)
    console.print(_table(results))
    notes = {"clips": list(windows.name), "seed": config.seed, **run.origin}
    write_json(run.directory / "results.json", {"models": results, **notes})
    console.print(str(run.directory / "results.json"), soft_wrap=True)


if __name__ == "__main__":
    main()
