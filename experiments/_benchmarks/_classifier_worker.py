"""Times and measures one implementation of the classifier on request: a script that needs no aerojax for PyTorch.

    python _classifier_worker.py {jax|torch} '{"option": value, …}' THREADS [MEMORY]

Requests are JSON lines {act, clips, frames, tokens, memory} on standard input; an answer is one line that begins with
`ANSWER`. `act` is forward or step. With `memory`, the call is measured for memory and belongs to a fresh process. With
MEMORY, the file of `aerojax.training.memory`, which imports nothing of JAX, the C library keeps what the process frees.
"""

from __future__ import annotations

import ctypes
import importlib
import json
import os
import runpy
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

ANSWER = "classifier-answer "


def clips(count: int, frames: int, tokens: int) -> np.ndarray:
    """Gaussians about the origin; what they show does not change the cost."""
    rng = np.random.default_rng(0)
    columns = rng.normal(size=(count, frames, tokens, 14)).astype(np.float32)
    columns[..., 7:11] = rng.uniform(0.01, 0.1, columns[..., 7:11].shape)
    return columns


def status_kilobytes(name: str) -> int:
    """A line of /proc/self/status (Linux)."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith(f"{name}:"))


WARM_UP = (1, 2, 8)
"""Clips, frames and tokens of a first call, which loads what a framework loads lazily."""


def answer(engine: Any, request: dict[str, Any], loaded: list[Any]) -> dict[str, float]:
    """Do one call: wall-clock and processor seconds, or with `memory` megabytes.

    `process_mb` is the process' largest resident size during the call, framework and all; `call_mb` is how much of it
    the call adds to what the process held before, when model, inputs and program were there. What a compiler has freed
    is given back before.
    """
    size = (request["clips"], request["frames"], request["tokens"])
    call = getattr(engine, request["act"])
    if request.get("memory"):
        engine.load(clips(*WARM_UP))
        call()
    if loaded != [size]:
        engine.load(clips(*size))
        loaded[:] = [size]
    if not request.get("memory"):
        wall, cpu = time.perf_counter(), time.process_time()
        call()
        return {"wall": time.perf_counter() - wall, "cpu": time.process_time() - cpu}
    if hasattr(engine, "program"):
        engine.program(request["act"])
    ctypes.CDLL(None).malloc_trim(0)
    before = status_kilobytes("VmRSS")
    Path("/proc/self/clear_refs").write_text("5")
    call()
    peak = status_kilobytes("VmHWM")
    return {"call_mb": (peak - before) / 1024, "process_mb": peak / 1024}


def main() -> None:
    """Answer requests until the input ends."""
    name, options, threads = sys.argv[1], json.loads(sys.argv[2]), int(sys.argv[3])
    # The same processors for everybody: XLA and OpenMP make as many threads as they are allowed.
    os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:threads])
    if len(sys.argv) > 4:
        runpy.run_path(sys.argv[4])["keep_freed_memory"]()
    module = importlib.import_module(f"_classifier_{name}")
    engine, loaded = module.Engine(**options), []
    print(ANSWER + json.dumps({"version": engine.version, "parameters": engine.parameters}), flush=True)
    for line in sys.stdin:
        print(ANSWER + json.dumps(answer(engine, json.loads(line), loaded)), flush=True)


if __name__ == "__main__":
    main()
