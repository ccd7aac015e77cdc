"""How a service does: counts since its start, and times of its last frames."""

from __future__ import annotations

import threading
import time
from collections import Counter, deque
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from aerojax.pipeline.soak import Resources, resources
from aerojax.serve.intake import CameraCount

REMEMBERED = 1000
"""Frames whose times are kept: a service never ends, its memory must."""


@dataclass(frozen=True)
class Health:
    """A service at one moment.

    uptime_s: since its start. frames, partial, dropped: that were used, of those the ones that a camera which is not
    silent gave no picture for, and those that were not taken in time. waiting: in the buffer.
    rate: frames a second over the last `REMEMBERED`. latency_ms: 50th and 95th percentile and largest of the same, from
    the arrival of a frame's last picture to its messages. tracks: that are known. sightings: by what they were
    answered with. unusable: by code. cameras: by name. stages_ms: medians. resources: of the process.
    failed_sends: by sink.
    """

    uptime_s: float
    frames: int
    partial: int
    dropped: int
    waiting: int
    rate: float
    latency_ms: tuple[float, float, float] | None
    latency_sum_s: float
    tracks: int
    sightings: Mapping[str, int]
    unusable: Mapping[str, int]
    cameras: Mapping[str, CameraCount]
    stages_ms: Mapping[str, float]
    resources: Resources
    failed_sends: Mapping[str, int] = field(default_factory=dict)


class Figures:
    """Counts as frames pass; safe to be read from other threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._began = time.monotonic()
        self._ends: deque[float] = deque(maxlen=REMEMBERED)
        self._latency: deque[float] = deque(maxlen=REMEMBERED)
        self._sum, self._frames = 0.0, 0
        self._sightings: Counter[str] = Counter()
        self._unusable: Counter[str] = Counter()

    def frame(self, latency_s: float) -> None:
        """One frame that ended now."""
        with self._lock:
            self._frames += 1
            self._latency.append(latency_s)
            self._sum += latency_s
            self._ends.append(time.monotonic())

    def sighting(self, answer: str) -> None:
        """An object of a frame, by what it was answered with."""
        with self._lock:
            self._sightings[answer] += 1

    def unusable(self, code: str) -> None:
        """An object of a frame, or a frame, that could not be used."""
        with self._lock:
            self._unusable[code] += 1

    def health(
        self,
        *,
        cameras: Mapping[str, CameraCount],
        partial: int,
        dropped: int,
        waiting: int,
        tracks: int,
        stages_ms: Mapping[str, float],
        failed_sends: Mapping[str, int],
    ) -> Health:
        """Everything now; what others count is given."""
        with self._lock:
            spent = 1e3 * np.array(self._latency)
            ends = self._ends
            rate = (len(ends) - 1) / (ends[-1] - ends[0]) if len(ends) > 1 and ends[-1] > ends[0] else 0.0
            latency = None
            if len(spent):
                median, slow, worst = (float(np.percentile(spent, share)) for share in (50, 95, 100))
                latency = (median, slow, worst)
            return Health(
                uptime_s=time.monotonic() - self._began,
                frames=self._frames,
                partial=partial,
                dropped=dropped,
                waiting=waiting,
                rate=rate,
                latency_ms=latency,
                latency_sum_s=self._sum,
                tracks=tracks,
                sightings=dict(self._sightings),
                unusable=dict(self._unusable),
                cameras=dict(cameras),
                stages_ms=dict(stages_ms),
                resources=resources(),
                failed_sends=dict(failed_sends),
            )
