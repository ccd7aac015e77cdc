"""Fuzzing for so many seconds: cases are numbered, drawn by format, and spread over watched processes."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from multiprocessing.connection import wait
from pathlib import Path

import numpy as np

from aerojax.evaluate.fuzz.workers import Limits, Tally, Target, Worker

POLL = 0.2
"""Seconds after which processes that say nothing are looked at."""
Progress = Callable[[int, int, str], None]


def cases(weights: Mapping[str, float], seed: int) -> Iterator[tuple[str, int]]:
    """Format and number of each case, without end; the same for one seed however many processes read them."""
    names = sorted(weights)
    share = np.array([weights[name] for name in names]) / sum(weights.values())
    rng = np.random.default_rng([seed, 0])
    case = 0
    while True:
        for name in rng.choice(len(names), 1024, p=share):
            yield names[int(name)], case
            case += 1


def fuzz(
    targets: Mapping[str, Target],
    folder: Path,
    *,
    seconds: float,
    seed: int,
    workers: int,
    limits: Limits,
    progress: Progress | None = None,
) -> Tally:
    """Read changed files until the time is over.

    Args:
        targets: by the name of their format.
        folder: for the inputs, one folder a process in it.
        seconds: from when all processes are ready.
        seed: of the changes.
        workers: processes.
        limits: of one case.
        progress: of (seconds gone, seconds, what).

    Raises:
        RuntimeError: an input that is right is not read, so that the rest would say nothing.
    """
    tally = Tally()
    drawn = cases({name: target.weight for name, target in targets.items()}, seed)
    crew = [Worker(targets, folder / f"worker_{i}", seed, limits) for i in range(workers)]
    try:
        while not all(worker.idle for worker in crew):
            wait([worker.connection for worker in crew], timeout=POLL)
            for worker in crew:
                worker.outcome()
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            for worker in crew:
                if (ended := worker.outcome()) is not None:
                    tally.add(*worker.case, ended)
                if worker.idle:
                    worker.ask(*next(drawn))
            if progress is not None:
                done = f"{tally.inputs} inputs, {len(tally.findings)} findings"
                progress(int(seconds - left), int(seconds), done)
            wait([worker.connection for worker in crew], timeout=POLL)
        return tally
    finally:
        for worker in crew:
            worker.stop()
