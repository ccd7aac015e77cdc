"""The door of stage 1: where the objects are in every image."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, runtime_checkable

from aerojax.capture.format import CaptureCamera
from aerojax.core.types import FrameSet, Silhouette


@runtime_checkable
class Preview(Protocol):
    """Frames that may be looked at before the first step: a whole capture, or what a live source has recorded."""

    def __call__(self, count: int, *, rgb: bool, ids: bool) -> Iterator[FrameSet]:
        """At most `count` frames, spread evenly and in order, with images (`rgb`) and masks (`ids`) as asked for."""
        ...


@runtime_checkable
class Segmenter(Protocol):
    """Finds the objects of each frame. A value: what it remembers is in its state."""

    def initial(self, cameras: Sequence[CaptureCamera], preview: Preview | None = None) -> Any:
        """The state before the first frame; without a preview nothing looks ahead.

        Raises:
            UserError: the preview shows that what is asked for is not there.
        """
        ...

    def step(self, frames: FrameSet, state: Any) -> tuple[list[Silhouette], Any]:
        """Silhouettes of all objects in all cameras, and the next state."""
        ...


@dataclass(frozen=True)
class SegmenterConfig(ABC):
    """Configuration of a member, chosen by its name: `segment=given`."""

    members: ClassVar[str] = "aerojax.segment.members"

    @abstractmethod
    def build(self, object_id: int | None) -> Segmenter:
        """The member; `object_id` is the instance to follow where masks name instances, None to choose one."""
