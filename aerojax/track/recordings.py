"""What was seen and by whom, of any kind of source."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from aerojax.capture.format import Capture, read_capture
from aerojax.core.errors import UserError
from aerojax.track.camera_files import read_cameras
from aerojax.track.detection_files import read_detections
from aerojax.track.drone_tracking import is_drone_tracking, read_drone_tracking
from aerojax.track.masks import mask_detections
from aerojax.track.sights import Detections, TimedCamera, timed


def read_recording(
    source: Path,
    cameras: Path | None,
    *,
    progress: Callable[[int, int, str], None] = lambda done, total, what: None,
) -> tuple[Detections, tuple[TimedCamera, ...], Capture | None]:
    """Detections and their cameras; the capture, if it is one.

    Args:
        source: a capture with masks of instances, a recording of drone-tracking-datasets, or detections.
        cameras: a file of cameras, which detections need; others have their own if None.
        progress: called for each frame of masks with (done, total, what).

    Raises:
        UserError: names the file and what is wrong with it.
    """
    known = None if cameras is None else read_cameras(cameras)
    given = None if known is None else known.cameras
    if (source / "capture.json").is_file():
        capture = read_capture(source)
        own = tuple(timed(camera) for camera in capture.cameras)
        return mask_detections(capture, progress=progress), _same(own, given, source), capture
    if is_drone_tracking(source):
        own, detections = read_drone_tracking(source)
        return detections, _same(own, given, source), None
    if known is None:
        raise UserError("missing", "cameras is not set", "give capture.json or a file like it: cameras=FILE")
    return read_detections([source], known), known.cameras, None


def _same(own: tuple[TimedCamera, ...], given: tuple[TimedCamera, ...] | None, source: Path) -> tuple[TimedCamera, ...]:
    """The given cameras, or its own where none are given."""
    if given is None:
        return own
    if [camera.name for camera in given] != [camera.name for camera in own]:
        names = ", ".join(camera.name for camera in own)
        raise UserError("mismatch", f"cameras: has other cameras than {source}", f"name {names}, in this order")
    return given


def recalibrated(capture: Capture, cameras: Sequence[TimedCamera]) -> Capture:
    """A capture whose cameras stand and tell the time as these do; rates and line delays have no place in it."""
    changed = tuple(
        replace(camera, world_from_cam=one.world_from_cam, time_offset_s=one.time_offset_s)
        for camera, one in zip(capture.cameras, cameras, strict=True)
    )
    return replace(capture, cameras=changed)
