"""Captures a second of `classify_archive` with one worker and with two, and what one costs."""

from __future__ import annotations

import os
import tempfile
import time
from pathlib import Path
from typing import Any

from aerojax.core.types import CLASSES
from aerojax.pipeline.archive import AskedOfCapture, classify_archive
from aerojax.simulate.plan.planner import SequenceConfig
from aerojax.simulate.sample import SampleConfig, sample_capture
from aerojax.simulate.world.random_rigs import RandomRigConfig

RIG = RandomRigConfig(cameras=5, span_px=(60.0, 60.0), distance=(20.0, 20.0))
FRAMES = 12
FEW, MANY = 4, 24
"""Captures, four different ones again and again: the difference of two times leaves out what every start costs."""
WORKERS = (1, 2)


def _cpu() -> float:
    """Processor seconds of this process and of its ended workers so far."""
    now = os.times()
    return now.user + now.system + now.children_user + now.children_system


def _ignore(done: int, total: int, what: str) -> None:
    """Nobody looks at the progress."""


def seconds(folders: list[Path], count: int, workers: int, out: Path) -> dict[str, float]:
    """Wall-clock and processor seconds to classify so many captures."""
    named = {f"{number:03d}": folders[number % len(folders)] for number in range(count)}
    begin, cpu = time.perf_counter(), _cpu()
    classify_archive(named, AskedOfCapture(), out, workers=workers, cluster="local", progress=_ignore)
    return {"captures": count, "seconds": time.perf_counter() - begin, "cpu_s": _cpu() - cpu}


def row(few: dict[str, float], many: dict[str, float], workers: int) -> dict[str, Any]:
    """What a capture takes beyond the start, by the longer run and the shorter one."""
    captures, spent, cpu = (many[key] - few[key] for key in ("captures", "seconds", "cpu_s"))
    one = {"seconds_a_capture": round(spent / captures, 4), "cpu_s_a_capture": round(cpu / captures, 4)}
    return {
        "workers": workers,
        "few": few,
        "many": many,
        **one,
        "start_cpu_s": round(few["cpu_s"] - FEW * cpu / captures, 2),
    }


def speed_up(rows: list[dict[str, Any]]) -> dict[str, float]:
    """How many times faster two workers are than one: by the clock, which others slow, and by what they compute.

    Two that do not hinder each other take as many processor seconds a capture as one, and half of the time.
    """
    one, two = rows
    return {
        "times_faster": round(one["seconds_a_capture"] / two["seconds_a_capture"], 2),
        "times_faster_by_processor_time": round(2 * one["cpu_s_a_capture"] / two["cpu_s_a_capture"], 2),
    }


def measure() -> dict[str, Any]:
    """One worker, then two: some minutes on two quiet cores; beside other programs see the second ratio."""
    load, rows, said = os.getloadavg()[0], [], set()
    with tempfile.TemporaryDirectory() as place:
        root = Path(place)
        sequence = SequenceConfig(rigs=(RIG,), frames=FRAMES, depth=False, white_dome=False)
        samples = [SampleConfig(label=name, folder=root / name, sequence=sequence) for name in CLASSES]
        folders = [sample_capture(one, root / "assets") for one in samples]
        for workers in WORKERS:
            few, many = (seconds(folders, n, workers, root / f"out_{workers}_{n}") for n in (FEW, MANY))
            rows.append(row(few, many, workers))
            said.add((root / f"out_{workers}_{MANY}/answers.jsonl").read_bytes())
    return {
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1,
        "load_average": load,
        "load_average_at_the_end": os.getloadavg()[0],
        "cameras": RIG.cameras,
        "pixels": [RIG.width, RIG.height],
        "frames": FRAMES,
        "rows": rows,
        **speed_up(rows),
        "equal_bytes": len(said) == 1,
        "cpu_ms_a_frame": round(1e3 * rows[0]["cpu_s_a_capture"] / FRAMES, 1),
    }
