"""Clips a second: the factory beside generated and reconstructed sequences, as many clips of as many frames."""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from aerojax.core.types import CLASSES
from aerojax.pipeline.clips import ClipsConfig, make_clips
from aerojax.pipeline.config import PipelineConfig
from aerojax.pipeline.factory.config import FactoryConfig
from aerojax.pipeline.factory.write import make_factory_clips
from aerojax.simulate.generate import Shard, generate_dataset
from experiments._benchmarks.simulator import dataset_config

FRAMES = 8
WORKERS = 2
FEW, MANY = 1, 7
"""Individuals of each class, a clip of each: the difference of the two times leaves out what every start costs."""
TOKENS = FactoryConfig().tokens


def _cpu() -> float:
    """Processor seconds of this process and of its ended workers so far."""
    now = os.times()
    return now.user + now.system + now.children_user + now.children_system


def _ignore(done: int, total: int, what: str) -> None:
    """Nobody looks at the progress."""


def factory_seconds(individuals: int, folder: Path) -> dict[str, float]:
    """Seconds to make clips of drawn rigs, lines, circles and spheres, at any distance and with faults."""
    config = FactoryConfig(individuals=individuals, clips=1, frames=FRAMES, tokens=TOKENS)
    begin, cpu = time.perf_counter(), _cpu()
    made = make_factory_clips(config, folder, workers=WORKERS, progress=_ignore)
    seconds = time.perf_counter() - begin
    return {"clips": float(sum(made.counts.values())), "seconds": seconds, "cpu_s": _cpu() - cpu}


def sequences_seconds(individuals: int, folder: Path) -> dict[str, float]:
    """Seconds to generate sequences of the small random networks (540×400 pixels) and to reconstruct them."""
    whole = dataset_config("random", "small")
    training = {"train": 1, "val": 0, "test": 0}
    config = replace(whole, frames=FRAMES, sequences=training, identities_per_class=individuals)
    clips = ClipsConfig(0, TOKENS, PipelineConfig())
    begin, cpu = time.perf_counter(), _cpu()
    generate_dataset(config, folder / "data", workers=WORKERS, shard=Shard(0, 1), progress=_ignore)
    middle = time.perf_counter()
    made = make_clips(clips, (folder / "data",), folder / "clips", only=("*",), workers=WORKERS, progress=_ignore)
    end = time.perf_counter()
    parts = {"generate_s": middle - begin, "reconstruct_s": end - middle}
    return {"clips": float(sum(made.counts.values())), "seconds": end - begin, "cpu_s": _cpu() - cpu, **parts}


def rates(few: dict[str, float], many: dict[str, float]) -> dict[str, Any]:
    """Clips a second of the longer run, with its start, and without what the shorter run took."""
    clips, seconds, cpu = (many[key] - few[key] for key in ("clips", "seconds", "cpu_s"))
    return {
        "few": few,
        "many": many,
        "clips_per_s": round(clips / seconds, 3),
        "clips_per_cpu_s": round(clips / cpu, 3),
        "clips_per_s_with_start": round(many["clips"] / many["seconds"], 3),
    }


def _measured(way: Callable[[int, Path], dict[str, float]]) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        few, many = (way(count, Path(folder) / str(count)) for count in (FEW, MANY))
    return rates(few, many)


def measure() -> dict[str, Any]:
    """Both ways one after the other, a few minutes on two quiet cores; beside other programs see the processor time."""
    load = os.getloadavg()[0]
    factory, sequences = _measured(factory_seconds), _measured(sequences_seconds)
    return {
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1,
        "load_average": load,
        "workers": WORKERS,
        "frames": FRAMES,
        "clips": {"few": FEW * len(CLASSES), "many": MANY * len(CLASSES)},
        "factory": factory,
        "sequences": sequences,
        "times_faster": round(factory["clips_per_s"] / sequences["clips_per_s"], 2),
        "times_faster_by_processor_time": round(factory["clips_per_cpu_s"] / sequences["clips_per_cpu_s"], 2),
        "load_average_at_the_end": os.getloadavg()[0],
    }
