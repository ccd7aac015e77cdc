"""The newest state of a site for a page to draw: cameras, tracks with their last places, and the latest messages."""

from __future__ import annotations

import threading
from collections import deque
from dataclasses import dataclass, field
from typing import Any

from aerojax.core.files import json_text
from aerojax.serve.messages import Message

TRAIL = 200
"""Places of a track that are kept."""
EVENTS = 50
"""Messages that are kept, those of sightings aside."""


@dataclass
class _Shown:
    latest: Message | None = None
    trail: deque[list[float]] = field(default_factory=lambda: deque(maxlen=TRAIL))


class Board:
    """Written by one thread, read by many; its size is bounded, because lost tracks leave it."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._started: Message | None = None
        self._tracks: dict[int, _Shown] = {}
        self._events: deque[Message] = deque(maxlen=EVENTS)
        self._health: Message | None = None

    def take(self, message: Message) -> None:
        """A message in its place."""
        with self._lock:
            match message["type"]:
                case "track":
                    shown = self._tracks.setdefault(message["track"], _Shown())
                    shown.latest = message
                    shown.trail.append(message["position"])
                    return
                case "started":
                    self._started = message
                case "health" | "stopped":
                    self._health = message
                    return
                case "lost":
                    self._tracks.pop(message["track"], None)
                case "unusable":
                    return
            self._events.appendleft(message)

    def see(self, health: Message) -> None:
        """The newest figures."""
        with self._lock:
            self._health = health

    def content(self) -> bytes:
        """All of it as JSON."""
        with self._lock:
            tracks = [
                {"trail": list(shown.trail), **shown.latest}
                for shown in self._tracks.values()
                if shown.latest is not None
            ]
            shown: dict[str, Any] = {
                "started": self._started,
                "tracks": tracks,
                "events": list(self._events),
                "health": self._health,
            }
            return json_text(shown, indent=None).encode()
