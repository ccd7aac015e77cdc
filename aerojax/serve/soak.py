"""The service over frames without end: rate, latency, memory and handles, window by window."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from aerojax.pipeline.step import Pipeline
from aerojax.serve.figures import Health
from aerojax.serve.messages import Message, Sighting
from aerojax.serve.service import Service, ServiceConfig
from aerojax.serve.sinks.base import Sink
from aerojax.serve.sources.base import Source


@dataclass(frozen=True)
class ServiceWindow:
    """Some frames of the service.

    frames: until its end. step_ms: wall-clock time a frame over its last thousand. processor_ms: of all threads, a
        frame, over the whole window.
    latency_ms, slowest_ms: median and 95th percentile from a frame's last picture to its messages, of the last
        thousand; where frames come as fast as they are taken, they wait in the buffer however fast that is.
    resident_mb, handles, threads: of the process at its end.
    tracks: known then. begun: since the service's start.
    """

    frames: int
    step_ms: float
    processor_ms: float
    latency_ms: float
    slowest_ms: float
    resident_mb: float
    handles: int
    threads: int
    tracks: int
    begun: int


class SoakSink:
    """A sink that keeps a service's figures after each window of frames.

    Args:
        total: frames of the service. windows: into which they are divided.
        progress: called after each window with (frames, total, what).
    """

    name, vital = "soak", False

    def __init__(self, total: int, windows: int, progress: Callable[[int, int, str], None]) -> None:
        self.windows: list[ServiceWindow] = []
        self._total, self._every, self._progress = total, max(total // windows, 1), progress
        self._begun, self._processor_s = 0, time.process_time()

    def send(self, message: Message, sighting: Sighting | None) -> None:
        """Count the tracks that begin."""
        self._begun += message["type"] == "appeared"

    def see(self, health: Health) -> None:
        """Keep the figures where a window has ended since the last look."""
        before = self.windows[-1].frames if self.windows else 0
        if health.latency_ms is None or health.frames // self._every == before // self._every:
            return
        median, slow, _ = health.latency_ms
        spent, self._processor_s = time.process_time() - self._processor_s, time.process_time()
        window = ServiceWindow(
            frames=health.frames,
            step_ms=1e3 / health.rate,
            processor_ms=1e3 * spent / (health.frames - before),
            latency_ms=median,
            slowest_ms=slow,
            resident_mb=health.resources.resident_mb,
            handles=health.resources.handles,
            threads=health.resources.threads,
            tracks=health.tracks,
            begun=self._begun,
        )
        self.windows.append(window)
        self._progress(health.frames, self._total, "frames")

    def close(self) -> None:
        """Nothing is open."""


def soak_service(
    source: Source,
    pipeline: Pipeline,
    sinks: Sequence[Sink],
    *,
    total: int,
    windows: int,
    state: Path,
    version: str,
    progress: Callable[[int, int, str], None],
) -> tuple[list[ServiceWindow], Health]:
    """Serve so many frames; see `Service`.

    Returns:
        What was seen after each window, and at the end.
    """
    watch = SoakSink(total, windows, progress)
    config = ServiceConfig(frames=total)
    health = Service(source, pipeline, [*sinks, watch], config, state=state, version=version).run(threading.Event())
    watch.see(health)
    return watch.windows, health
