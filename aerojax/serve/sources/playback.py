"""A finished capture, images or synchronised videos, played at its rate or as fast as it can be taken."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Literal

from aerojax.capture.format import Capture, read_capture
from aerojax.capture.frames import read_view
from aerojax.core.config import require_at_least
from aerojax.pipeline.source import capture_preview
from aerojax.segment.base import Preview
from aerojax.serve.intake import Intake
from aerojax.serve.pictures import Picture
from aerojax.serve.sources.base import SourceConfig

_PATIENCE_S = 0.2
"""After which a player that waits for room looks whether it is to stop."""


@dataclass(frozen=True)
class PlaybackConfig(SourceConfig):
    """A recording that is played.

    rate: seconds of the recording a second: 1 as it was recorded, and frames that are not taken in time are dropped;
        0 as fast as frames are taken, and none is dropped.
    repeat: how often it is played, with numbers and times that go on; 0 without end.
    look_ahead: whether backgrounds and objects are sought in the whole recording first, as `classify` does it.
    """

    name: Literal["playback"] = "playback"
    rate: float = 1.0
    repeat: int = 1
    look_ahead: bool = True

    def __post_init__(self) -> None:
        require_at_least(self, "rate", "repeat", least=0)

    def build(self, folder: Path) -> Playback:
        """The member that plays this capture."""
        return Playback(self, read_capture(folder))


@dataclass(frozen=True)
class Playback:
    """Plays a capture."""

    config: PlaybackConfig
    site: Capture
    numbered: bool = True

    def preview(self) -> Preview | None:
        """The whole recording, if it may be looked at."""
        return capture_preview(self.site) if self.config.look_ahead else None

    def run(self, intake: Intake, since: Mapping[int, int], stop: threading.Event) -> None:
        """Put every frame of every camera at its time; `since` names the last frame that is not played again."""
        first = 1 + max(since.values(), default=-1)
        total = self.site.frames * self.config.repeat
        begin, number = intake.clock(), first
        while not stop.is_set() and (total == 0 or number < total):
            if self.config.rate > 0:
                due = begin + (number - first) / (self.site.fps * self.config.rate)
                if stop.wait(max(due - intake.clock(), 0.0)):
                    return
            for camera in range(len(self.site.cameras)):
                while self.config.rate == 0 and not intake.wait_for_room(camera, _PATIENCE_S):
                    if stop.is_set():
                        return
                intake.put(self._picture(camera, number))
            number += 1

    def _picture(self, camera: int, number: int) -> Picture:
        frame = number % self.site.frames
        load = partial(read_view, self.site, camera, frame, rgb=True, ids=True)
        return Picture(camera, number / self.site.fps, number, load)
