"""Measure what classifying a clip costs: parameters, operations, latency and memory, by mode and size of the clip."""

from __future__ import annotations

import resource
import time
from dataclasses import dataclass
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np
from rich.console import Console
from rich.table import Table

from aerojax.classify.mambasplat.config import MambaSplatConfig, Mode, published_config
from aerojax.classify.mambasplat.cost import operations, parameter_count, unused_bridge_parameters
from aerojax.classify.mambasplat.model import MambaSplat
from aerojax.core.files import write_json
from aerojax.core.provenance import provenance
from experiments._launch.command import Run, experiment
from experiments._launch.progress import progress_bar


@dataclass(frozen=True)
class Size:
    """Frames of a clip and tokens of a frame."""

    frames: int
    tokens: int


@dataclass(frozen=True, kw_only=True)
class Config:
    """What is measured: every mode of every variant at every size; the median of `repeats` calls after one."""

    preset: str
    seed: int = 0
    variant: tuple[Literal["exact", "published"], ...] = ("exact", "published")
    mode: tuple[Mode, ...] = ("C", "X")
    sizes: tuple[Size, ...] = (Size(8, 96), Size(16, 128))
    repeats: int = 30


@jax.jit
def _classify(model: MambaSplat, columns: jax.Array, mask: jax.Array) -> jax.Array:
    return model(columns, mask)


def _clip(size: Size, seed: int) -> tuple[jax.Array, jax.Array]:
    """Gaussians in the unit ball; what they show does not change the cost."""
    rng = np.random.default_rng(seed)
    columns = rng.normal(size=(size.frames, size.tokens, 14)).astype(np.float32)
    columns[..., 7:11] = rng.uniform(0.01, 0.1, columns[..., 7:11].shape)
    return jnp.asarray(columns), jnp.ones(columns.shape[:2], bool)


def measure(model: MambaSplat, size: Size, *, repeats: int, seed: int) -> dict[str, Any]:
    """Seconds of compilation, milliseconds of a call, and bytes.

    `working_mb` is what the compiled program wants besides its inputs and outputs; `process_peak_mb` is the largest
    resident size of this process so far, with all that was measured before.
    """
    columns, mask = _clip(size, seed)
    start = time.perf_counter()
    program = _classify.lower(model, columns, mask).compile()
    compiled, memory = time.perf_counter() - start, program.memory_analysis()
    jax.block_until_ready(program(model, columns, mask))
    spent = []
    for _ in range(repeats):
        start = time.perf_counter()
        jax.block_until_ready(program(model, columns, mask))
        spent.append(1e3 * (time.perf_counter() - start))
    return {
        "compile_s": compiled,
        "latency_ms": float(np.median(spent)),
        "latency_ms_quartiles": np.quantile(spent, [0.25, 0.75]).tolist(),
        "working_mb": None if memory is None else memory.temp_size_in_bytes / 2**20,
        "arguments_mb": None if memory is None else memory.argument_size_in_bytes / 2**20,
        "process_peak_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**10,
    }


def _row(config: Config, made: MambaSplatConfig, size: Size) -> dict[str, Any]:
    model = MambaSplat(made, key=jax.random.key(config.seed))
    count, unused = parameter_count(made), unused_bridge_parameters(made)
    sizes = {"variant": made.variant, "mode": made.mode, "frames": size.frames, "tokens": size.tokens}
    counts = {"parameters": count, "parameters_with_unused_bridge": count + unused}
    counts |= {"gflop": operations(made, size.frames, size.tokens) / 1e9}
    return {**sizes, **counts, **measure(model, size, repeats=config.repeats, seed=config.seed)}


@experiment(Config)
def main(config: Config, run: Run) -> None:
    """Write results.json and print a row a variant, mode and size."""
    table = Table("variant", "mode", "T", "N", "parameters", "GFLOP", "ms", "GFLOP/s", "working MB", "peak MB")
    made = [
        (MambaSplatConfig if v == "exact" else published_config)(mode=m) for v in config.variant for m in config.mode
    ]
    rows = []
    with progress_bar() as bar:
        for one, size in bar.track([(m, s) for m in made for s in config.sizes], description="settings"):
            row = _row(config, one, size)
            rows.append(row)
            figures = row["gflop"], row["latency_ms"], 1e3 * row["gflop"] / row["latency_ms"]
            memory = "-" if row["working_mb"] is None else f"{row['working_mb']:.1f}", f"{row['process_peak_mb']:.0f}"
            named = (row["variant"], row["mode"], str(size.frames), str(size.tokens), f"{row['parameters']:,}")
            table.add_row(*named, *(f"{f:.2f}" for f in figures), *memory)
    Console().print(table)
    notes = {"device": jax.devices()[0].device_kind, "command": run.command, **provenance(run.overrides)}
    write_json(run.directory / "results.json", {"rows": rows, **notes})
    Console().print(str(run.directory / "results.json"), soft_wrap=True)


if __name__ == "__main__":
    main()
