"""The door behind segmentation: which silhouettes are one object, in all cameras and over time."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, runtime_checkable

from aerojax.capture.format import CaptureCamera
from aerojax.core.types import FrameSet, Silhouette, Track


@runtime_checkable
class Tracker(Protocol):
    """Follows objects. A value: what it remembers is in its state."""

    def initial(self, cameras: Sequence[CaptureCamera]) -> Any:
        """The state before the first frame; positions come in the frame of these cameras."""
        ...

    def step(self, frames: FrameSet, silhouettes: Sequence[Silhouette], state: Any) -> tuple[list[Track], Any]:
        """The objects of this frame, and the next state; an object that no camera shows is in no list."""
        ...


@dataclass(frozen=True)
class TrackerConfig(ABC):
    """Configuration of a member, chosen by its name: `track=single`."""

    members: ClassVar[str] = "aerojax.track.members"

    @abstractmethod
    def build(self) -> Tracker:
        """The member."""
