"""The door of live sources: threads that put pictures into the intake until they are told to stop."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Protocol, runtime_checkable

from aerojax.capture.format import Capture
from aerojax.segment.base import Preview
from aerojax.serve.intake import Intake


@runtime_checkable
class Source(Protocol):
    """Pictures of a network's cameras, now and later."""

    @property
    def site(self) -> Capture:
        """The cameras, their frame rate and where they stand."""
        ...

    @property
    def numbered(self) -> bool:
        """Whether times are frame numbers over the frame rate, so that frame 0 is the recording's own."""
        ...

    def preview(self) -> Preview | None:
        """What may be looked at before the first frame; None where nothing may."""
        ...

    def run(self, intake: Intake, since: Mapping[int, int], stop: threading.Event) -> None:
        """Put pictures until `stop` is set; returns early where no more will come.

        Args:
            intake: where they go.
            since: by camera, the number of the last picture that an earlier service made a frame of.
            stop: ends it within about a second.
        """
        ...


@dataclass(frozen=True)
class SourceConfig(ABC):
    """Configuration of a member, chosen by its name: `sources=folder`."""

    members: ClassVar[str] = "aerojax.serve.sources.members"

    @abstractmethod
    def build(self, folder: Path) -> Source:
        """The member.

        Args:
            folder: with `capture.json`.

        Raises:
            UserError: the cameras or their pictures are not described as this source needs it.
        """
