"""The service: pictures in, frame by frame through the pipeline, messages out, until it is told to end."""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np

from aerojax.capture.format import Capture, CaptureCamera
from aerojax.classify.base import Classifier
from aerojax.core.config import require_at_least, to_mapping
from aerojax.core.errors import UserError
from aerojax.core.files import fingerprint, json_text
from aerojax.geometry.cameras import pixel_rays
from aerojax.pipeline.events import Dropped
from aerojax.pipeline.step import Pipeline
from aerojax.pipeline.trust import TrustConfig
from aerojax.serve.figures import Figures, Health
from aerojax.serve.intake import Intake, IntakeConfig, Taken
from aerojax.serve.messages import Message, Sighting, Teller, health_message, message
from aerojax.serve.pictures import read_pictures
from aerojax.serve.saving import Saver
from aerojax.serve.sinks.base import Sink
from aerojax.serve.sources.base import Source
from aerojax.serve.state_files import ServiceState, read_service_state

_POLL_S = 0.1
"""How long a frame is waited for before the service looks whether it is to end."""
_SEEN_EVERY_S = 0.5
"""Seconds between two looks of the sinks at the figures."""


@dataclass(frozen=True)
class ServiceConfig:
    """How a service runs.

    intake: how pictures become frames. trust: from when on an answer is believed.
    save_s: seconds between two saved states, which is what a kill may lose.
    health_s: seconds between two messages of figures.
    idle_s: ends the service when no camera gave anything for so long; never if None.
    frames: ends it after so many; never if 0.
    """

    intake: IntakeConfig = field(default_factory=IntakeConfig)
    trust: TrustConfig = field(default_factory=TrustConfig)
    save_s: float = 5.0
    health_s: float = 60.0
    idle_s: float | None = None
    frames: int = 0

    def __post_init__(self) -> None:
        require_at_least(self, "save_s", "health_s", least=0.01)
        require_at_least(self, "frames", least=0)
        if self.idle_s is not None:
            require_at_least(self, "idle_s", least=0.01)


def require_stream(classifier: Classifier) -> None:
    """Refuse a classifier that waits for a clip's end.

    Raises:
        UserError: it is not causal.
    """
    if not classifier.causal:
        problem = f"weights: {classifier.card.name} waits for the end of a clip, and a stream has none"
        raise UserError("mismatch", problem, "name weights of a causal classifier")


def made_with(site: Capture, pipeline: Pipeline, classifier: Classifier) -> dict[str, str]:
    """What a state must agree with to be gone on from: hashes of cameras, settings and weights' card."""
    cameras = [
        [c.name, c.width, c.height, c.K.tolist(), c.world_from_cam.tolist(), c.time_offset_s] for c in site.cameras
    ]
    parts = {
        "cameras": json_text(cameras),
        "settings": json_text([to_mapping(pipeline.config), site.fps]),
        "weights": classifier.card.to_json(),
    }
    return {name: fingerprint(text.encode()) for name, text in parts.items()}


class Service:
    """One run; make it, then call `run` once.

    Args:
        source: of pictures.
        pipeline: of the source's cameras, with a causal classifier.
        sinks: that take the messages.
        config: see there.
        state: file that an earlier service left, if it is there, and this one leaves.
        version: what the first message says of the program.

    ended: when the last run did.

    Raises:
        UserError: the classifier is not causal, or the state is of another service.
    """

    def __init__(
        self,
        source: Source,
        pipeline: Pipeline,
        sinks: Sequence[Sink],
        config: ServiceConfig,
        *,
        state: Path,
        version: str,
    ) -> None:
        assert pipeline.classifier is not None
        require_stream(pipeline.classifier)
        self._source, self._pipeline, self._sinks, self._config = source, pipeline, sinks, config
        self._classifier, self._version = pipeline.classifier, version
        ours = made_with(source.site, pipeline, pipeline.classifier)
        self._state = read_service_state(state, ours) if state.is_file() else ServiceState()
        self._saver = Saver(state, ours, config.save_s)
        self._intake = Intake(
            len(source.site.cameras), source.site.fps, config.intake, after_s=_made_until(self._state, source.site.fps)
        )
        self._teller = Teller(source.site, pipeline.world_from_rig, config.trust)
        self._figures, self._failed = Figures(), Counter[str]()
        self.ended = datetime.now(UTC)
        self._unread = False  # nobody reads what it is there for
        self._done, self._seen_s, self._told_s = 0, -np.inf, self._intake.clock()

    def run(self, stop: threading.Event) -> Health:
        """Serve until `stop` is set, the source ends or the configuration says so; the state is saved then."""
        self._begin()
        try:
            with self._reading(stop), ThreadPoolExecutor(len(self._source.site.cameras)) as executor:
                while not (stop.is_set() or self._finished()):
                    self._turn(executor)
        finally:
            self._saver.finish(self._state)
            self._tell_problems()
            health, self.ended = self.health(), datetime.now(UTC)
            self._send(health_message("stopped", self.ended, health))
            for sink in self._sinks:
                sink.close()
        return health

    def health(self) -> Health:
        """How it does now."""
        names = [camera.name for camera in self._source.site.cameras]
        known = self._state.pipeline
        return self._figures.health(
            cameras=dict(zip(names, self._intake.counts(), strict=True)),
            partial=self._intake.partial,
            dropped=self._intake.dropped,
            waiting=self._intake.waiting,
            tracks=0 if known is None else len(known.objects),
            stages_ms=self._pipeline.watch.medians(),
            failed_sends=self._failed,
        )

    def _begin(self) -> None:
        """The state to go on from, and the first message."""
        now, before = datetime.now(UTC), self._state.pipeline
        resumed = None if before is None else self._state.frame
        if before is None:
            state = self._pipeline.initial(self._source.preview())
        elif before.segment is None:  # what could not be stored
            segmenter = self._pipeline.segmenter
            state = replace(before, segment=segmenter.initial(self._pipeline.cameras, self._source.preview()))
        else:
            state = before
        self._state = replace(self._state, pipeline=state, began=self._state.began or now.isoformat())
        told = {"classifier": self._classifier.card.name, "aerojax": self._version, "began": self._state.began}
        cameras = [_shown(camera) for camera in self._source.site.cameras]
        self._send(message("started", now, cameras=cameras, **told, resumed=resumed))

    @contextmanager
    def _reading(self, stop: threading.Event) -> Iterator[None]:
        """The source at work in a thread of its own; what ends it unexpectedly ends the service."""
        ending, failed = threading.Event(), []

        def read() -> None:
            try:
                self._source.run(self._intake, dict(self._state.numbers), ending)
            except BaseException as error:
                failed.append(error)
            finally:
                self._intake.close()

        thread = threading.Thread(target=read, name="source", daemon=True)
        thread.start()
        try:
            yield
        finally:
            ending.set()
            thread.join()
        if failed:
            raise failed[0]

    def _finished(self) -> bool:
        config = self._config
        idle = config.idle_s is not None and self._intake.waiting == 0 and self._intake.idle_s >= config.idle_s
        return self._unread or self._intake.ended or idle or 0 < config.frames <= self._done

    def _turn(self, executor: Executor) -> None:
        """One frame, or what there is to say without one."""
        taken = self._intake.take(_POLL_S)
        for notice in self._intake.notices():
            self._send(self._teller.notice(notice, datetime.now(UTC)))
        if taken is not None:
            self._frame(taken, executor)
        self._saver.offer(self._state)
        self._tell_problems()
        now = self._intake.clock()
        if now - self._seen_s >= _SEEN_EVERY_S:
            self._seen_s, health = now, self.health()
            for sink in self._sinks:
                sink.see(health)
        if now - self._told_s >= self._config.health_s:
            self._told_s = now
            self._send(health_message("health", datetime.now(UTC), self.health()))

    def _frame(self, taken: Taken, executor: Executor) -> None:
        """Look at one frame and say what it shows."""
        clock = self._intake.clock
        arrived = datetime.now(UTC) - timedelta(seconds=clock() - taken.arrived_s)
        frame, time_s, zero_s = self._numbered(taken.time_s)
        with self._pipeline.watch.stage("read"):
            frames = read_pictures(taken.pictures, frame, time_s, executor)
        assert self._state.pipeline is not None
        events, after = self._pipeline.step(frames, self._state.pipeline)
        numbers = {one.camera: one.number for one in taken.pictures if one is not None and one.number is not None}
        self._state = replace(
            self._state,
            pipeline=after,
            numbers={**self._state.numbers, **numbers},
            zero_s=zero_s,
            frame=frame,
            time_s=time_s,
        )
        for event in events:
            if isinstance(event, Dropped):
                self._figures.unusable("nothing-there" if event.track is None else event.code)
        for told in self._teller.events(events, after.objects, time_s, arrived):
            if isinstance(told, Sighting):
                self._figures.sighting(told.message["label"] or told.message["status"])
                self._send(told.message, told)
            else:
                self._send(told)
        self._figures.frame(clock() - taken.arrived_s)
        self._done += 1

    def _numbered(self, source_s: float) -> tuple[int, float, float]:
        """Number and time of a frame on the network's clock, and that clock's zero by the source's.

        Where the source's clock was set back between two services, the network's goes on from where it stood.
        """
        fps, last = self._source.site.fps, self._state
        if last.zero_s is None:
            zero_s = 0.0 if self._source.numbered else source_s
        else:
            late = source_s - last.zero_s <= last.time_s
            zero_s = source_s - (last.time_s + 1 / fps) if late else last.zero_s
        time_s = source_s - zero_s
        return max(last.frame + 1, round(time_s * fps)), time_s, zero_s

    def _send(self, told: Message, sighting: Sighting | None = None) -> None:
        """Give a message to every sink; one that fails loses it, and the others do not."""
        for sink in self._sinks:
            try:
                sink.send(told, sighting)
            except OSError as error:
                self._failed[sink.name] += 1
                self._unread = self._unread or (sink.vital and isinstance(error, BrokenPipeError))

    def _tell_problems(self) -> None:
        for text in self._saver.problems():
            self._send(message("state", datetime.now(UTC), text=text))


def _made_until(state: ServiceState, fps: float) -> float:
    """Source time up to which frames were made of numbered pictures; streams may have had their clocks set back."""
    if state.zero_s is None or not state.numbers:
        return float("-inf")
    return state.zero_s + state.time_s + 0.5 / fps


def _shown(camera: CaptureCamera) -> Mapping[str, object]:
    """A camera for those who draw it."""
    middle = camera.height / 2
    rays = pixel_rays(np.array([[0.0, middle], [float(camera.width), middle]]), camera)
    return {"name": camera.name, "position": camera.world_from_cam[:3, 3].tolist(), "view": rays.tolist()}
