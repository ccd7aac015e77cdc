"""The ellipsoid of `support.networks` on disk: a folder with cameras that grows frame by frame, and a clock by hand."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from support.networks import frame_sets

from aerojax.capture.format import Capture, CaptureCamera, write_capture_json
from aerojax.core.types import FrameSet
from aerojax.serve.pictures import Picture

FPS = 30.0


def write_site(
    folder: Path, cameras: Sequence[CaptureCamera], frames: int | None = None, fps: float = FPS, **more: object
) -> Path:
    """`capture.json` of cameras; without `frames` it says nothing of how many there will be."""
    folder.mkdir(parents=True, exist_ok=True)
    write_capture_json(Capture(folder, fps, frames or 1, tuple(cameras), None), overwrite=True)
    raw = json.loads((folder / "capture.json").read_text())
    if frames is None:
        del raw["frames"]
    (folder / "capture.json").write_text(json.dumps({**raw, **more}))
    return folder


def write_frame(folder: Path, cameras: Sequence[CaptureCamera], frames: FrameSet, number: int | None = None) -> None:
    """Images and masks of one moment, each under its own name at once."""
    number = frames.frame if number is None else number
    for camera, image, ids in zip(cameras, frames.rgb, frames.ids, strict=True):
        pictures = {} if camera.mask is None else {camera.mask: ids.astype(np.uint16)}
        pictures[camera.rgb] = np.round(255 * image[..., ::-1]).astype(np.uint8)
        for pattern, picture in pictures.items():
            path = folder / pattern.replace("{frame:06d}", f"{number:06d}")
            path.parent.mkdir(parents=True, exist_ok=True)
            cv2.imwrite(str(path.with_suffix(".part.png")), picture)
            path.with_suffix(".part.png").replace(path)


def write_frames(folder: Path, cameras: tuple[CaptureCamera, ...], frames: range) -> None:
    """The ellipsoid in these frames."""
    for one in frame_sets(cameras, frames):
        write_frame(folder, cameras, one)


class Clock:
    """A clock that goes on when it is told to."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


def picture(camera: int, time_s: float, number: int | None = None) -> Picture:
    """One that shows nothing."""
    return Picture(camera, time_s, number, lambda: (None, None, None))
