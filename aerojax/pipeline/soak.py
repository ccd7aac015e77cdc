"""A stream without end: time, memory and handles over many steps, and whether the answer wanders."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float

from aerojax.core.types import FrameSet
from aerojax.pipeline.events import Updated
from aerojax.pipeline.step import Pipeline
from aerojax.pipeline.stream import stream


@dataclass(frozen=True)
class SoakWindow:
    """Some frames of the stream.

    frames: until its end. step_ms, slowest_ms: median and 99th percentile of a step's wall-clock time.
    resident_mb: memory of the process at its end. handles, threads: open then.
    """

    frames: int
    step_ms: float
    slowest_ms: float
    resident_mb: float
    handles: int
    threads: int


@dataclass(frozen=True)
class Soaked:
    """What a stream of so many frames showed.

    updated: frames that ended in an answer.
    compared: passes after the one that answers are compared with.
    drift: largest change of a probability at the same frame of the loop, any later pass against that one.
    last_drift: the same of the last whole pass alone.
    """

    windows: tuple[SoakWindow, ...]
    frames: int
    updated: int
    compared: int
    drift: float
    last_drift: float


def looped(frames: Sequence[FrameSet], total: int, fps: float) -> Iterator[FrameSet]:
    """A recording again and again, with numbers and times that go on."""
    for number in range(total):
        yield replace(frames[number % len(frames)], frame=number, time_s=number / fps)


def soak(
    pipeline: Pipeline,
    frames: Sequence[FrameSet],
    *,
    fps: float,
    total: int,
    windows: int,
    settled: int,
    progress: Callable[[int, int, str], None],
) -> Soaked:
    """Run a pipeline over a loop of frames.

    Args:
        pipeline: with a causal classifier.
        frames: of the loop, in memory.
        fps: of the stream.
        total: steps.
        windows: into which they are divided.
        settled: passes before the one that later answers are compared with; the first ones still gather evidence.
        progress: called after each window with (steps, total, what).
    """
    found: list[SoakWindow] = []
    reference, one_pass = np.zeros((len(frames), 4)), np.zeros((len(frames), 4))
    spent: list[float] = []
    updated, compared, drift, last, begin = 0, 0, 0.0, 0.0, time.perf_counter()
    for number, (events, _) in enumerate(stream(pipeline, looped(frames, total, fps))):
        spent.append(1e3 * (time.perf_counter() - begin))
        answers = [e.log_probabilities for e in events if isinstance(e, Updated) and e.log_probabilities is not None]
        updated += len(answers)
        passes, phase = divmod(number, len(frames))
        one_pass[phase] = np.exp(answers[0]) if answers else 0.0
        if phase == len(frames) - 1 and passes == settled:
            reference = one_pass.copy()
        elif phase == len(frames) - 1 and passes > settled:
            last, compared = _largest(one_pass, reference), compared + 1
            drift = max(drift, last)
        if (number + 1) % max(total // windows, 1) == 0:
            found.append(_window(number + 1, spent))
            spent = []
            progress(number + 1, total, "frames")
        begin = time.perf_counter()
    return Soaked(tuple(found), total, updated, compared, drift, last)


def _largest(one: Float[np.ndarray, "time label"], other: Float[np.ndarray, "time label"]) -> float:
    return float(np.abs(one - other).max())


@dataclass(frozen=True)
class Resources:
    """What the process holds. resident_mb: memory. handles, threads: open now."""

    resident_mb: float
    handles: int
    threads: int


def resources() -> Resources:
    """Of this process now."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    handles = len(list(Path("/proc/self/fd").iterdir()))
    return Resources(pages * 4096 / 1e6, handles, threading.active_count())


def _window(frames: int, spent: Sequence[float]) -> SoakWindow:
    median, slow = (float(np.percentile(spent, share)) for share in (50, 99))
    held = resources()
    return SoakWindow(frames, median, slow, held.resident_mb, held.handles, held.threads)
