"""Count parameters and operations of the networks of the thesis' tables, as it counts them; nothing is run."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, get_args

import jax
from rich.console import Console
from rich.table import Table

from aerojax.classify.baselines import cost as baselines
from aerojax.classify.baselines.config import Mamba4DConfig, P4TransformerConfig, VNDGCNNConfig, VNPointNetConfig
from aerojax.classify.mambasplat import cost as mambasplat
from aerojax.classify.mambasplat.config import Mode, published_config
from aerojax.core.files import write_json
from aerojax.core.tensors import parameter_count
from aerojax.reconstruct.depthsplat.config import parity_config
from aerojax.reconstruct.depthsplat.cost import part_sizes, published_operations
from aerojax.reconstruct.lgm.config import published_config as lgm_config
from experiments._launch.command import Run, experiment

WIDTHS, DEPTHS, FRAMES = (64, 128, 256, 512), (1, 2, 4, 8), (4, 8, 12, 16, 24)
"""Of the thesis' tables 6.14, 6.15 and 6.16."""


@dataclass(frozen=True, kw_only=True)
class Config:
    """Sizes of what networks are given.

    frames, tokens: of a clip, for classifiers. views: of a frame, for reconstructors.
    classes: of the baselines on points, as their papers count them.
    """

    preset: str
    frames: int = 24
    tokens: int = 1024
    views: int = 5
    classes: int = 10


def _mambasplat(config: Config) -> Iterator[dict[str, Any]]:
    """The six modes; then widths, depths and lengths of a clip of E(X)."""
    made = [(f"MambaSplat-4D E({mode})", {"mode": mode}, config.frames) for mode in get_args(Mode)]
    made += [(f"MambaSplat-4D width {width}", {"d_model": width}, config.frames) for width in WIDTHS]
    made += [(f"MambaSplat-4D layers {depth}", {"mamba_layers": depth}, config.frames) for depth in DEPTHS]
    made += [(f"MambaSplat-4D frames {frames}", {}, frames) for frames in FRAMES]
    for name, changes, frames in made:
        model = published_config(**changes)
        count = mambasplat.parameter_count(model) + mambasplat.unused_bridge_parameters(model)
        work = mambasplat.published_operations(model, frames, config.tokens)
        yield {"network": name, "parameters": count, "gflop": work / 1e9}


def _baselines(config: Config) -> Iterator[dict[str, Any]]:
    static = (VNPointNetConfig(classes=config.classes), 1), (VNDGCNNConfig(classes=config.classes), 1)
    for model, frames in (*static, (P4TransformerConfig(), config.frames), (Mamba4DConfig(), config.frames)):
        count = baselines.parameter_count(model) + baselines.unread_parameters(model)
        work = baselines.operations(model, frames, config.tokens)
        yield {"network": model.label.partition(",")[0], "parameters": count, "gflop": work / 1e9}


def _reconstructors(config: Config) -> Iterator[dict[str, Any]]:
    splat = parity_config()
    work = published_operations(splat, config.views)
    yield {"network": "DepthSplat-OC", "parameters": sum(part_sizes(splat).values()), "gflop": work / 1e9}
    shapes: Any = jax.eval_shape(lambda key: lgm_config().untrained(key=key), jax.random.key(0))
    yield {"network": "LGM", "parameters": parameter_count(shapes.network), "gflop": None}


@experiment(Config, finished_by="results.json")
def main(config: Config, run: Run) -> None:
    """Write results.json and print a row a network."""
    rows = [*_mambasplat(config), *_baselines(config), *_reconstructors(config)]
    table = Table("network", "parameters", "GFLOP")
    for row in rows:
        table.add_row(row["network"], f"{row['parameters']:,}", "-" if row["gflop"] is None else f"{row['gflop']:.2f}")
    Console().print(table)
    notes = {"frames": config.frames, "tokens": config.tokens, "views": config.views}
    write_json(run.directory / "results.json", {"rows": rows, **notes, **run.origin})


if __name__ == "__main__":
    main()
