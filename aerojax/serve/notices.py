"""What a live source says besides its pictures: cameras that fall silent, frames that are dropped, retries."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class CameraSilent:
    """A camera gave nothing for `seconds`; frames are made without it."""

    camera: int
    seconds: float


@dataclass(frozen=True)
class CameraBack:
    """A camera that was silent gives pictures again."""

    camera: int


@dataclass(frozen=True)
class CamerasLacking:
    """So few cameras are left that no frames are made until others come back."""

    left: int
    needed: int


@dataclass(frozen=True)
class FramesDropped:
    """The oldest waiting frames were dropped because the buffer was full; `total` since the start."""

    count: int
    total: int


@dataclass(frozen=True)
class SourceFailed:
    """A camera, or all where it is None, could not be read; it is tried again after `retry_s`."""

    camera: int | None
    text: str
    retry_s: float


Notice = CameraSilent | CameraBack | CamerasLacking | FramesDropped | SourceFailed
