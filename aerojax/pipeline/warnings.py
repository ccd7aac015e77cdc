"""What the user of a result should know: views that were missing, and cameras in another convention."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from aerojax.capture.format import Capture, CaptureCamera
from aerojax.capture.frames import read_frames
from aerojax.core.types import MissingView
from aerojax.pipeline.events import OneCamera, Updated
from aerojax.pipeline.source import capture_preview
from aerojax.pipeline.step import Pipeline
from aerojax.track.conventions import Convention, fitting_convention

LOOKED_AT = 5
"""Frames, spread evenly, in which other conventions are tried."""


def missing_warnings(capture: Capture, missing: Sequence[tuple[int, MissingView]]) -> tuple[str, ...]:
    """One sentence for each camera that lacks frames: how many, and what is wrong with the first.

    Args:
        capture: whose frames they are.
        missing: views with the numbers of their frames.
    """
    by_camera: dict[int, list[MissingView]] = {}
    for _, view in missing:
        by_camera.setdefault(view.camera, []).append(view)
    return tuple(
        f"camera {capture.cameras[camera].name}: left out of {len(views)} of {capture.frames} frames ({views[0].text})"
        for camera, views in sorted(by_camera.items())
    )


def shift_warnings(updates: Sequence[Updated], frames: int) -> tuple[str, ...]:
    """A sentence on the frames in which cameras had to be displaced to fit the others; none where all fit."""
    shifts = [event.shift_m for event in updates if event.shift_m > 0]
    if not shifts:
        return ()
    text = f"the silhouettes fit only with cameras displaced by up to {max(shifts):.2g} m at the object"
    return (f"{len(shifts)} of {frames} frames: {text}; check calibration and clocks",)


def cut_warnings(updates: Sequence[Updated], cameras: Sequence[CaptureCamera], frames: int) -> tuple[str, ...]:
    """A sentence on the frames in which cameras that show a part of the object are used; none where all is whole."""
    cut = [event.cut for event in updates if event.cut]
    if not cut:
        return ()
    names = ", ".join(cameras[camera].name for camera in sorted({camera for some in cut for camera in some}))
    return (f"{len(cut)} of {frames} frames use cameras whose border cuts the object: {names}",)


def one_camera_warnings(
    seen: Mapping[int, OneCamera], cameras: Sequence[CaptureCamera], frames: int
) -> tuple[str, ...]:
    """A sentence on an answer without a place; none where the object has one.

    Args:
        seen: what the camera that alone shows the whole object shows, by the frame's number.
        cameras: of the capture.
        frames: how many it has.
    """
    if not seen:
        return ()
    names = ", ".join(cameras[camera].name for camera in sorted({one.camera for one in seen.values()}))
    text = f"answered from {len(seen)} of {frames} frames, in each of which one camera alone shows the whole object"
    return (f"{text} ({names}): it has no place and no Gaussians, and no other camera can contradict the answer",)


def convention_of(capture: Capture, pipeline: Pipeline, frames: Sequence[int]) -> Convention | None:
    """The convention of cameras with which silhouettes meet that do not meet as given, if a usual one does it.

    Args:
        capture: as it was read.
        pipeline: of its cameras.
        frames: numbers of frames in which the silhouettes do not meet; some of them are segmented again.
    """
    chosen = np.unique(np.linspace(0, len(frames) - 1, LOOKED_AT).astype(int)) if frames else ()
    state = pipeline.segmenter.initial(pipeline.cameras, capture_preview(capture))
    seen = []
    for index in chosen:
        silhouettes, state = pipeline.segmenter.step(read_frames(capture, frames[int(index)]), state)
        seen.append(silhouettes)
    return fitting_convention(seen, capture.cameras)
