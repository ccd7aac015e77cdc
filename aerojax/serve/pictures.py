"""One camera's picture before it is read, and pictures of one moment as the frame that the pipeline takes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

from aerojax.capture.frames import CameraView
from aerojax.core.errors import UserError
from aerojax.core.types import FrameSet, MissingView


@dataclass(frozen=True, eq=False)
class Picture:
    """What one camera recorded at one moment.

    camera: index in the network. time_s: on the network's clock, from whatever zero the source has.
    number: of the file or frame, by which the source finds its place again; None for streams.
    load: reads it; a `UserError` leaves the camera out of the frame.
    """

    camera: int
    time_s: float
    number: int | None
    load: Callable[[], CameraView]


def read_pictures(
    pictures: Sequence[Picture | None], frame: int, time_s: float, executor: Executor | None = None
) -> FrameSet:
    """Read the pictures of one moment, all at once where there is an executor.

    Args:
        pictures: one entry a camera; None where it gave none.
        frame, time_s: number and seconds, as in `FrameSet`.
        executor: in whose threads they are read.
    """
    read = map if executor is None else executor.map
    found = list(read(_read, pictures))
    images, masks, coverage = zip(*(view for view, _ in found), strict=True)
    missing = tuple(MissingView(camera, text) for camera, (_, text) in enumerate(found) if text)
    return FrameSet(frame, time_s, images, masks, coverage, missing)


def _read(picture: Picture | None) -> tuple[CameraView, str]:
    """What a picture shows, and what is wrong with it: a service goes on where a capture would be refused."""
    if picture is None:
        return (None, None, None), ""
    try:
        return picture.load(), ""
    except UserError as error:
        return (None, None, None), str(error)
    except OSError as error:
        return (None, None, None), f"camera {picture.camera}: {error}"
