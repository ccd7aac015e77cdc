"""What a service says, as JSON objects: every one has `format`, `version`, `type` and `time`; `message.schema.json`."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64

from aerojax.capture.format import Capture
from aerojax.core.types import CLASSES, UNKNOWN
from aerojax.geometry.geodesy import geographic
from aerojax.pipeline.events import Appeared, Dropped, Event, Lost, Updated
from aerojax.pipeline.results import point_json
from aerojax.pipeline.step import TrackState
from aerojax.pipeline.track_points import SOLID, TrackPoint, size_of, velocity_at
from aerojax.pipeline.trust import Record, TrustConfig, judge
from aerojax.serve.figures import Health
from aerojax.serve.notices import CameraBack, CameraSilent, CamerasLacking, FramesDropped, Notice, SourceFailed

FORMAT, VERSION = "aerojax-live", 1
"""What a message says of itself. The version grows when a key changes its meaning or goes; new keys may come."""
SCHEMA = Path(__file__).with_name("message.schema.json")
"""JSON Schema (draft 2020-12) of a message."""

Message = dict[str, Any]


@dataclass(frozen=True, eq=False)
class Sighting:
    """One object in one frame, as sinks take it: a message, and the point of the track that it tells of."""

    message: Message
    point: TrackPoint
    track: int
    moment: datetime


@dataclass(frozen=True, eq=False)
class Teller:
    """Makes messages of events.

    site: the cameras. trust: from when on an answer is believed.
    """

    site: Capture
    world_from_rig: Float64[np.ndarray, "4 4"]
    trust: TrustConfig

    def events(
        self, events: Sequence[Event], objects: Mapping[int, TrackState], time_s: float, moment: datetime
    ) -> Iterator[Message | Sighting]:
        """Messages of one frame.

        Args:
            events: of the frame.
            objects: that are known after it.
            time_s: of the frame, network's clock.
            moment: when its pictures arrived.
        """
        for event in events:
            head = {"frame": event.frame, "time_s": time_s}
            if isinstance(event, Updated):
                yield self._sighting(event, objects[event.track].record, time_s, moment)
            elif isinstance(event, Dropped) and event.track is not None:  # an empty sky needs no message a frame
                told = {"track": event.track, "code": event.code, "text": event.text}
                yield message("unusable", moment, **head, **told, **self._by_one_camera(event, objects))
            elif isinstance(event, Appeared | Lost):
                yield message(type(event).__name__.lower(), moment, **head, track=event.track)

    def _by_one_camera(self, event: Dropped, objects: Mapping[int, TrackState]) -> dict[str, Any]:
        """What is said without a place where one camera alone shows the object; nothing elsewhere."""
        seen = event.one_camera
        if seen is None or seen.log_probabilities is None or event.track is None:
            return {}
        verdict = judge(objects[event.track].record, self.site.cameras, seen.log_probabilities, self.trust)
        probabilities = np.exp(np.asarray(seen.log_probabilities, np.float64))
        told = {
            "camera": self.site.cameras[seen.camera].name,
            "box": list(seen.box),
            "status": verdict.status,
            "reasons": [asdict(reason) for reason in verdict.reasons],
            "most_likely": CLASSES[int(np.argmax(probabilities))],
            "probabilities": dict(zip(CLASSES, probabilities.tolist(), strict=True)),
        }
        return {"one_camera": told}

    def _sighting(self, event: Updated, record: Record, time_s: float, moment: datetime) -> Sighting:
        point = self._point(event, record, time_s)
        given = record, self.site.cameras, event.log_probabilities, self.trust
        verdict = judge(*given, fps=self.site.fps, familiarity=event.familiarity)
        names = [self.site.cameras[index].name for index in _used(event)]
        told = {
            "track": event.track,
            "status": verdict.status,
            "reasons": [asdict(reason) for reason in verdict.reasons],
            "label": (UNKNOWN if verdict.unknown else point.label) if verdict.status == "ok" else None,
            "most_likely": point.label,
            "familiarity": verdict.familiarity,
            "cameras": names,
            "shift_m": event.shift_m,
        }
        return Sighting(message("track", moment, **told, **point_json(point)), point, event.track, moment)

    def _point(self, event: Updated, record: Record, time_s: float) -> TrackPoint:
        assert event.log_probabilities is not None  # a service has a classifier that answers frame by frame
        probabilities = np.exp(np.asarray(event.log_probabilities, np.float64))
        opacity = np.asarray(event.gaussians.opacity)
        origin, x, y, z = self.site.origin, *map(float, event.position)
        place = None if origin is None else tuple(geographic(event.position[None], origin)[0].tolist())
        return TrackPoint(
            frame=event.frame,
            time_s=time_s,
            position=(x, y, z),
            velocity=self._velocity(record),
            size=size_of(np.asarray(event.gaussians.mean, np.float64)[opacity > SOLID]),
            probabilities=dict(zip(CLASSES, probabilities.tolist(), strict=True)),
            place=place,
        )

    def _velocity(self, record: Record) -> tuple[float, float, float] | None:
        """From the last places, which the verdict remembers anyhow; metres a second, world."""
        if len(record.path) < 2:
            return None
        times = np.array([moment for moment, _ in record.path])
        places = np.stack([place for _, place in record.path]) @ self.world_from_rig[:3, :3].T
        return velocity_at(times, places, len(times) - 1)

    def notice(self, notice: Notice, moment: datetime) -> Message:
        """A message of what the intake or a source notes."""
        cameras = self.site.cameras
        match notice:
            case CameraSilent(camera, seconds):
                text = f"no picture for {seconds:.1f} s, or only such as came too late for their frame"
                return message("camera", moment, camera=cameras[camera].name, state="silent", text=text)
            case CameraBack(camera):
                return message("camera", moment, camera=cameras[camera].name, state="back", text="gives pictures again")
            case SourceFailed(camera, problem, retry_s):
                name = None if camera is None else cameras[camera].name
                told = {"text": problem, "retry_s": retry_s}
                return message("camera", moment, camera=name, state="failed", **told)
            case CamerasLacking(left, needed):
                text = f"{left} of {len(cameras)} cameras give pictures, {needed} are needed: nothing is looked at"
                return message("lacking", moment, cameras=left, needed=needed, text=text)
            case FramesDropped(count, total):
                return message("dropped", moment, frames=count, total=total)


def _used(event: Updated) -> list[int]:
    """Cameras that count, where they are known."""
    if event.observation is None:
        return []
    return [int(index) for index in np.flatnonzero(event.observation.valid)]


def message(kind: str, moment: datetime, **content: Any) -> Message:
    """A message of a kind, at a moment."""
    time = moment.astimezone(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
    return {"format": FORMAT, "version": VERSION, "type": kind, "time": time, **content}


def health_message(kind: str, moment: datetime, health: Health) -> Message:
    """How the service does: `health` now and then, `stopped` at its end."""
    latency = health.latency_ms
    spread = None if latency is None else dict(zip(("p50", "p95", "max"), latency, strict=True))
    figures = {key: value for key, value in asdict(health).items() if key != "latency_sum_s"}
    return message(kind, moment, **{**figures, "latency_ms": spread})


def message_schema() -> dict[str, Any]:
    """The JSON Schema of a message, as the package ships it."""
    return json.loads(SCHEMA.read_text(encoding="utf-8"))
