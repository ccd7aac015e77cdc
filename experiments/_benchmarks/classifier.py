"""The classifier beside the same network in plain PyTorch: time of a forward pass and of a training step; memory."""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from aerojax.training import memory as process_memory

MISSING = "not measured: install .[bench], or name a Python that has torch, VN-transformer and mambapy in TORCH_PYTHON"
THREADS = 2
REPEATS = 7
REPEATS_FULL = 3
LENGTHS = (16, 32, 64, 128, 256, 512)
LENGTH_TOKENS = 64
_WORKER = Path(__file__).with_name("_classifier_worker.py")
_ANSWER = "classifier-answer "
IMPLEMENTATIONS: dict[str, tuple[str, dict[str, Any]]] = {
    "exact": ("jax", {"variant": "exact"}),
    "published": ("jax", {"variant": "published"}),
    "torch": ("torch", {"flash": False}),
    "torch_flash": ("torch", {"flash": True}),
}
"""Ours in both variants; PyTorch with attention written out and with its fused one."""


@dataclass(frozen=True)
class Size:
    """Clips of a batch, frames of a clip, tokens of a frame."""

    clips: int
    frames: int
    tokens: int


SIZES = (Size(1, 24, 1024), Size(1, 16, 256))
FULL = SIZES[0]


def torch_python() -> str | None:
    """A Python with the packages of the comparison: this one, or the one that TORCH_PYTHON names."""
    if all(importlib.util.find_spec(name) for name in ("torch", "VN_transformer", "mambapy")):
        return sys.executable
    return os.environ.get("TORCH_PYTHON")


class Worker:
    """One implementation in a process of its own.

    Raises:
        RuntimeError: it ended instead of answering; its last words are in the message.
    """

    def __init__(self, process: subprocess.Popen[str]):
        self._process = process
        self.about = self._answer()

    def call(self, act: str, size: Size, *, memory: bool = False) -> dict[str, float]:
        """One forward pass or training step: seconds, or with `memory` megabytes."""
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps({"act": act, "memory": memory, **asdict(size)}) + "\n")
        self._process.stdin.flush()
        return self._answer()

    def _answer(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        last: list[str] = []
        for line in self._process.stdout:
            if line.startswith(_ANSWER):
                return json.loads(line.removeprefix(_ANSWER))
            last = [*last[-19:], line]
        raise RuntimeError("the worker ended: " + "".join(last))


@contextmanager
def open_worker(name: str, *, keep: bool = False) -> Iterator[Worker]:
    """The process of one of `IMPLEMENTATIONS`; with `keep` it keeps the memory that it frees, as training does."""
    framework, options = IMPLEMENTATIONS[name]
    python = sys.executable if framework == "jax" else torch_python()
    assert python is not None
    command = [
        python,
        str(_WORKER),
        framework,
        json.dumps(options),
        str(THREADS),
        *[str(process_memory.__file__)] * keep,
    ]
    pipes: Any = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
    with subprocess.Popen(command, text=True, **pipes) as process:
        try:
            yield Worker(process)
        finally:
            process.kill()


def times(names: list[str], act: str, size: Size) -> dict[str, dict[str, list[float]]]:
    """Interleaved repetitions: every implementation once, then every one again; a first round compiles and warms up."""
    spent: dict[str, dict[str, list[float]]] = {name: {"wall": [], "cpu": []} for name in names}
    with ExitStack() as stack:
        workers = {name: stack.enter_context(open_worker(name, keep=True)) for name in names}
        for repeat in range(1 + (REPEATS_FULL if size == FULL else REPEATS)):
            for name, worker in workers.items():
                answer = worker.call(act, size)
                for clock in spent[name] if repeat else ():
                    spent[name][clock].append(answer[clock])
    return spent


def peak_megabytes(name: str, act: str, size: Size) -> dict[str, float]:
    """Of one call in a fresh process: what it adds (`call_mb`) and the whole process at that moment (`process_mb`)."""
    with open_worker(name) as worker:
        return worker.call(act, size, memory=True)


def compare(names: list[str], act: str, size: Size) -> dict[str, Any]:
    """One row: medians of seconds and memory, and how many times ours are faster and smaller than each of PyTorch's.

    Ratios are medians over repetitions of neighbours in time, so that a machine's slow moments weigh on both.
    """
    spent = times(names, act, size)
    memory = {name: peak_megabytes(name, act, size) for name in names}
    row: dict[str, Any] = {"act": act, **asdict(size)}
    for name in names:
        row[name] = {f"{clock}_s": round(float(np.median(values)), 4) for clock, values in spent[name].items()}
        row[name] |= {key: round(value, 1) for key, value in memory[name].items()}
    for ours in (name for name in names if IMPLEMENTATIONS[name][0] == "jax"):
        for theirs in (name for name in names if IMPLEMENTATIONS[name][0] == "torch"):
            pairs = zip(spent[theirs]["wall"], spent[ours]["wall"], strict=True)
            row[f"{ours}_over_{theirs}"] = {
                "times_faster": round(float(np.median([b / a for b, a in pairs])), 2),
                "times_less_memory": round(memory[theirs]["call_mb"] / memory[ours]["call_mb"], 2),
                "times_smaller_process": round(memory[theirs]["process_mb"] / memory[ours]["process_mb"], 2),
            }
    return row


def growth_in_time(act: str) -> dict[str, Any]:
    """Processor seconds of the exact variant over a 32-fold range of frames, and the slope in log-log."""
    rows = []
    with open_worker("exact", keep=True) as worker:
        for frames in LENGTHS:
            size = Size(1, frames, LENGTH_TOKENS)
            answers = [worker.call(act, size) for _ in range(REPEATS + 1)][1:]
            row = {clock + "_s": float(np.median([answer[clock] for answer in answers])) for clock in ("wall", "cpu")}
            rows.append({"frames": frames, "tokens": LENGTH_TOKENS, **row})
    logs = np.log([[row["frames"], row["wall_s"]] for row in rows])
    return {"rows": rows, "slope": round(float(np.polyfit(logs[:, 0], logs[:, 1], 1)[0]), 3)}


def about(names: list[str]) -> dict[str, Any]:
    """Versions and numbers of parameters."""
    found = {}
    for name in names:
        with open_worker(name) as worker:
            found[name] = worker.about
    return found


def measure() -> dict[str, Any] | str:
    """All figures: some minutes on two quiet cores; without PyTorch ours alone."""
    if not sys.platform.startswith("linux"):
        return "not measured (needs Linux)"
    names = [name for name, (kind, _) in IMPLEMENTATIONS.items() if kind == "jax" or torch_python()]
    return {
        "implementations": about(names) if torch_python() else {**about(names), "torch": MISSING},
        "note": "PyTorch: VN-transformer and mambapy, eager; sizes of the published model (7 slots a token). `exact` "
        "has 4 slots a token by design, `published` has 7. One clip in a batch, float32, two threads each. For "
        "times all keep the memory that they free (`aerojax.training.memory`, as training does); for memory none does.",
        "rows": [compare(names, act, size) for size in SIZES for act in ("forward", "step")],
        "full_forward_process_mb": round(peak_megabytes("exact", "forward", FULL)["process_mb"], 1),
        "growth_in_time": {act: growth_in_time(act) for act in ("forward", "step")},
    }
