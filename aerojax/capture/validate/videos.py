"""Checks of a camera's video: what its container says, and on request every picture's time."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from aerojax.capture.codecs.video import BrokenVideo, VideoReader, open_video, pictures_near
from aerojax.capture.paths import is_inside
from aerojax.capture.validate.findings import Clock, Findings, is_finite_number, size_problem

_SAME_RATE = 0.01
"""Relative difference of frame rates that is none: 29.97 and 30 differ by a thousandth."""


def check_video(folder: Path, camera: dict[str, Any], name: str, clock: Clock, field: str, found: Findings) -> None:
    """Note what is wrong with a video, and what its user should know about its rate, length and rotation.

    Args:
        folder: the capture's folder.
        camera: the camera's entry in `capture.json`, unchecked.
        name: of the video, relative.
        clock: the capture's; where it refuses missing files, the whole video is decoded.
        field: JSON path of `rgb`.
        found: where problems and warnings go.
    """
    path = folder / name
    if not is_inside(folder, path, outside=clock.outside):
        found.add(field, "links out of the capture's folder", "put the file into the folder", file=name)
        return
    if not path.is_file():
        found.add(field, "the file is missing", "put the video there or correct capture.json", file=name)
        return
    try:
        video = open_video(path)
    except OSError as error:
        found.add(field, f"cannot be read: {error.strerror}", "check the permissions", file=name)
        return
    except BrokenVideo as broken:
        found.add(field, broken.problem, broken.remedy, file=name)
        return
    if problem := size_problem(video.width, video.height, camera):
        found.add(field, problem, "correct the size in capture.json; it is that of the stored pictures", file=name)
    if video.rotation % 360:
        message = f"its metadata turn the pictures by {video.rotation}°, which is not done"
        found.warn(field, message, "calibrate the stored pictures", file=name)
    if clock.fps is not None and clock.fps > 0 and clock.frames is not None:
        offset = camera.get("time_offset_s", 0.0)
        _check_times(video, clock, offset if is_finite_number(offset) else 0.0, field, name, found)


def _check_times(video: VideoReader, clock: Clock, offset_s: float, field: str, name: str, found: Findings) -> None:
    assert clock.fps is not None and clock.frames is not None
    wanted = f"the capture {clock.frames} frames at {clock.fps:g} a second"
    if clock.refuse:
        asked = np.arange(clock.frames) / clock.fps - offset_s
        # Before its first frame and behind its last one the camera was not recording.
        asked = asked[(asked > -0.5 / clock.fps) & (asked < (clock.frames - 0.5) / clock.fps)]
        times = video.times()
        shown = np.count_nonzero(pictures_near(times, asked, 0.5 / clock.fps))
        if shown < len(asked):
            message = f"has {len(times)} frames, which show {shown} of the capture's {clock.frames}"
            found.add(field, message, 'lower `frames`, correct `fps`, or write "missing": "drop"', file=name)
        return
    count, rate = video.frame_count(), video.fps or clock.fps
    slow = clock.fps * (1 - _SAME_RATE) > rate
    if slow or count / rate + max(offset_s, 0.0) < (clock.frames - 0.5) / clock.fps:
        message = f"has {count} frames at {rate:g} a second, {wanted}"
        found.warn(field, message, "the camera is left out of frames that it has no picture of", file=name)
