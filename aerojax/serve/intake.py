"""A bounded buffer between sources and the pipeline: pictures go in camera by camera, frames come out matched by time.

A frame is made of the oldest waiting picture and of those of the other cameras that are at most `tolerance_s` later.
It waits for cameras that have given nothing yet, but no longer than `wait_s`. When a camera's buffer is full, the
oldest frame is dropped, of all cameras, so that what stays still fits together. A camera that gives nothing for
`silent_s` is not waited for until it comes back.
"""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from aerojax.core.config import require_at_least
from aerojax.serve.notices import CameraBack, CameraSilent, CamerasLacking, FramesDropped, Notice
from aerojax.serve.pictures import Picture


@dataclass(frozen=True)
class IntakeConfig:
    """How pictures become frames.

    tolerance_s: by which pictures of one frame may differ in time; half a frame if None. Cameras that nobody triggers
        at the same moment need almost a whole one.
    buffer: pictures of a camera that may wait; beyond it the oldest frames are dropped.
    tell_s: at most so often it is said how many were; at once when it begins.
    wait_s: how long a frame waits for cameras that are late.
    silent_s: after which a camera that gives nothing is named, and not waited for.
    fewest: cameras that must give pictures; with fewer, nothing is made of them.
    """

    tolerance_s: float | None = None
    buffer: int = 16
    tell_s: float = 5.0
    wait_s: float = 0.25
    silent_s: float = 3.0
    fewest: int = 3

    def __post_init__(self) -> None:
        require_at_least(self, "buffer", "fewest")
        require_at_least(self, "wait_s", "tell_s", least=0)
        require_at_least(self, "silent_s", least=1e-3)
        if self.tolerance_s is not None:
            require_at_least(self, "tolerance_s", least=0)


@dataclass(frozen=True, eq=False)
class Taken:
    """A frame's pictures, one entry a camera. arrived_s: when the last of them came, by the intake's clock."""

    pictures: tuple[Picture | None, ...]
    arrived_s: float

    @property
    def time_s(self) -> float:
        """Of the oldest picture, on the network's clock."""
        return min(one.time_s for one in self.pictures if one is not None)


@dataclass
class _Waiting:
    """One camera's buffer, with the moments at which its pictures came."""

    pictures: deque[tuple[Picture, float]]
    last_s: float
    silent: bool = False
    given: int = 0
    late: int = 0
    surplus: int = 0


@dataclass(frozen=True)
class CameraCount:
    """One camera's pictures: given, too late for their frame, more than one a frame; and whether it is silent."""

    given: int
    late: int
    surplus: int
    silent: bool


class Intake:
    """The buffer. Threads of sources `put`, one thread `take`s.

    Args:
        cameras: how many.
        fps: frames a second of the network.
        config: see there.
        after_s: time of the source up to which an earlier service has made frames: pictures until then are late.
        clock: seconds, for waiting.
    """

    def __init__(
        self,
        cameras: int,
        fps: float,
        config: IntakeConfig,
        *,
        after_s: float = float("-inf"),
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._config, self._clock = config, clock
        self._tolerance = 0.5 / fps if config.tolerance_s is None else config.tolerance_s
        self._changed = threading.Condition()
        self._cameras = [_Waiting(deque(), clock()) for _ in range(cameras)]
        self._notices: list[Notice] = []
        self._until = after_s  # pictures up to here were taken or dropped with their frame
        self._dropped, self._told, self._partial = 0, 0, 0
        self._told_s = -math.inf
        self._lacking, self._closed = False, False

    @property
    def clock(self) -> Callable[[], float]:
        """By which it measures waiting, seconds."""
        return self._clock

    def put(self, picture: Picture) -> None:
        """Give a camera's next picture; where its buffer is full the oldest frame is dropped."""
        with self._changed:
            camera, now = self._cameras[picture.camera], self._clock()
            camera.given += 1
            if picture.time_s <= self._until:
                camera.late += 1  # and the watchdog hears nothing of it: a clock that is wrong is as good as silence
                return
            camera.last_s = now
            camera.pictures.append((picture, now))
            while len(camera.pictures) > self._config.buffer:
                self._pop()
                self._dropped += 1
            self._changed.notify_all()

    def has_room(self, camera: int) -> bool:
        """Whether a picture can be put without one being dropped, for sources that can wait."""
        with self._changed:
            return len(self._cameras[camera].pictures) < self._config.buffer

    def wait_for_room(self, camera: int, timeout_s: float) -> bool:
        """Wait until there is room; False where there is none after `timeout_s`."""
        with self._changed:
            room = self._config.buffer
            return self._changed.wait_for(lambda: len(self._cameras[camera].pictures) < room, timeout_s)

    def note(self, notice: Notice) -> None:
        """Add a source's own notice."""
        with self._changed:
            self._notices.append(notice)
            self._changed.notify_all()

    def close(self) -> None:
        """Nothing more will be put: what waits is taken without waiting for cameras."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    @property
    def ended(self) -> bool:
        """Whether it is closed, and everything was taken."""
        with self._changed:
            return self._closed and not any(camera.pictures for camera in self._cameras)

    @property
    def waiting(self) -> int:
        """Pictures of the camera that has most of them waiting."""
        with self._changed:
            return max(len(camera.pictures) for camera in self._cameras)

    @property
    def dropped(self) -> int:
        """Frames that were dropped since the start."""
        return self._dropped

    @property
    def partial(self) -> int:
        """Frames that were taken without a picture of a camera that is not silent: clocks or rates differ."""
        return self._partial

    @property
    def idle_s(self) -> float:
        """Seconds since any camera gave a picture."""
        with self._changed:
            return self._clock() - max(camera.last_s for camera in self._cameras)

    def counts(self) -> tuple[CameraCount, ...]:
        """What became of each camera's pictures."""
        with self._changed:
            return tuple(CameraCount(c.given, c.late, c.surplus, c.silent) for c in self._cameras)

    def notices(self) -> tuple[Notice, ...]:
        """What was noted since the last call."""
        with self._changed:
            self._watch()
            found, self._notices = self._notices, []
            now = self._clock()
            if self._dropped > self._told and (self._closed or now - self._told_s >= self._config.tell_s):
                found.append(FramesDropped(self._dropped - self._told, self._dropped))
                self._told, self._told_s = self._dropped, now
            return tuple(found)

    def take(self, timeout_s: float) -> Taken | None:
        """The next frame's pictures; None where there is none for `timeout_s`, or something to note, or the end."""
        with self._changed:
            end = self._clock() + timeout_s
            while True:
                self._watch()
                due = self._due()
                now = self._clock()
                if due is not None and due <= now:
                    taken = self._pop()
                    pairs = zip(self._cameras, taken.pictures, strict=True)
                    self._partial += any(one is None and not camera.silent for camera, one in pairs)
                    self._changed.notify_all()
                    return taken
                left = min(end, end if due is None else due) - now
                if left <= 0 or self._notices or (due is None and self._closed):
                    return None
                self._changed.wait(left)

    def _due(self) -> float | None:
        """When the oldest frame is to be taken; None where there is none."""
        waiting = [camera.pictures[0] for camera in self._cameras if camera.pictures]
        if not waiting or self._lacking:
            return None
        oldest = min(waiting, key=lambda entry: entry[0].time_s)
        complete = all(camera.pictures or camera.silent for camera in self._cameras)
        return oldest[1] if complete or self._closed else oldest[1] + self._config.wait_s

    def _pop(self) -> Taken:
        """Take the oldest frame off the buffers."""
        oldest = min(camera.pictures[0][0].time_s for camera in self._cameras if camera.pictures)
        self._until = oldest + self._tolerance
        found: list[Picture | None] = []
        arrived = float("-inf")
        for camera in self._cameras:
            mine = []
            while camera.pictures and camera.pictures[0][0].time_s <= self._until:
                mine.append(camera.pictures.popleft())
            camera.surplus += max(len(mine) - 1, 0)
            found.append(mine[0][0] if mine else None)
            arrived = max([arrived, *(moment for _, moment in mine[:1])])
        return Taken(tuple(found), arrived)

    def _watch(self) -> None:
        """Notice cameras that fell silent or came back."""
        if self._closed:
            self._lacking = False
            return
        now = self._clock()
        for index, camera in enumerate(self._cameras):
            quiet = 0.0 if camera.pictures else now - camera.last_s
            if not camera.silent and quiet >= self._config.silent_s:
                camera.silent = True
                self._notices.append(CameraSilent(index, quiet))
            elif camera.silent and quiet < self._config.silent_s:
                camera.silent = False
                self._notices.append(CameraBack(index))
        left = sum(not camera.silent for camera in self._cameras)
        lacking = left < min(self._config.fewest, len(self._cameras))
        if lacking and not self._lacking:
            self._notices.append(CamerasLacking(left, self._config.fewest))
        self._lacking = lacking
