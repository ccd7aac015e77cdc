"""Whether the cameras of a capture agree: the rays through one object meet, and where they do not, why that may be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from aerojax.capture.format import Capture, CaptureCamera
from aerojax.capture.frames import read_frames
from aerojax.core.types import Silhouette
from aerojax.geometry.cameras import points_in_camera, project_points
from aerojax.pipeline.source import capture_preview
from aerojax.segment.base import SegmenterConfig
from aerojax.track.conventions import FEWEST_CAMERAS, Convention, fitting_convention
from aerojax.track.single import triangulate

_MET, _MET_PX = 0.25, 2.0
"""A silhouette sees the meeting point that is less than this off its centre, in diagonals of its box and in pixels."""


@dataclass(frozen=True, eq=False)
class RigCheck:
    """What the silhouettes of some frames say about the cameras.

    frames: that were looked at. usable: those in which enough cameras show the object whole.
    met: those of them in which every ray meets the others' at the object.
    offset_px: by camera, the median distance of the silhouette's centre from where the rays meet; None where it never
        shows the object.
    positions: where they meet, metres, world.
    convention: another convention with which the silhouettes meet that do not meet as given.
    """

    frames: int
    usable: int
    met: int
    offset_px: dict[str, float | None]
    positions: Float64[np.ndarray, "frame 3"]
    convention: Convention | None

    @property
    def agrees(self) -> bool | None:
        """Whether the cameras agree in most frames; None where no frame could tell."""
        return None if self.usable == 0 else 2 * self.met > self.usable

    def sentence(self) -> str:
        """What came out, for people."""
        if self.agrees is None:
            return f"no object was seen whole by {FEWEST_CAMERAS} cameras in {self.frames} frames: cameras not checked"
        known = [offset for offset in self.offset_px.values() if offset is not None]
        worst = (
            f"rays through the object meet in {self.met} of {self.usable} frames, off by {max(known):.1f} px at most"
        )
        if self.agrees:
            return worst
        if self.convention is None:
            return f"{worst}; no usual other convention fits: check calibration, masks and clocks"
        return f"{worst}; they meet if {self.convention.name}: {self.convention.remedy}"


def check_rig(capture: Capture, segment: SegmenterConfig, *, most: int = 8, object_id: int | None = None) -> RigCheck:
    """Look at frames spread over a capture.

    Args:
        capture: as it was read.
        segment: how the object is found.
        most: frames.
        object_id: instance to follow; the largest if None.

    Returns:
        See `check_rays`.

    Raises:
        UserError: images cannot be read, or no camera shows anything.
    """
    chosen = np.unique(np.linspace(0, capture.frames - 1, most).astype(int))
    segmenter = segment.build(object_id)
    state = segmenter.initial(capture.cameras, capture_preview(capture))
    seen = []
    for frame in chosen:
        silhouettes, state = segmenter.step(read_frames(capture, int(frame)), state)
        whole = {one.camera: one for one in reversed(silhouettes) if one.whole}
        seen.append(list(whole.values()))
    return check_rays(seen, capture.cameras)


def check_rays(frames: Sequence[Sequence[Silhouette]], cameras: Sequence[CaptureCamera]) -> RigCheck:
    """Whether the rays through whole silhouettes of one object meet.

    Args:
        frames: at most one silhouette a camera in each.
        cameras: as they were given.
    """
    usable = [silhouettes for silhouettes in frames if len(silhouettes) >= FEWEST_CAMERAS]
    offsets: dict[int, list[float]] = {}
    met, positions = 0, []
    for silhouettes in usable:
        found = triangulate(silhouettes, cameras, 1.0)
        if found is None:
            continue
        off = [_offset(one, cameras[one.camera], found[0]) for one in silhouettes]
        positions.append(found[0])
        met += all(value <= _MET * _diagonal(one) + _MET_PX for one, value in zip(silhouettes, off, strict=True))
        for one, value in zip(silhouettes, off, strict=True):
            offsets.setdefault(one.camera, []).append(value)
    medians = {i: float(np.median(values)) for i, values in offsets.items()}
    return RigCheck(
        frames=len(frames),
        usable=len(usable),
        met=met,
        offset_px={camera.name: medians.get(i) for i, camera in enumerate(cameras)},
        positions=np.array(positions, np.float64).reshape(-1, 3),
        convention=None if 2 * met > len(usable) else fitting_convention(usable, cameras),
    )


def _diagonal(one: Silhouette) -> float:
    x0, y0, x1, y1 = one.box
    return float(np.hypot(x1 - x0, y1 - y0))


def _offset(one: Silhouette, camera: CaptureCamera, point: Float64[np.ndarray, "3"]) -> float:
    """Pixels from the silhouette's centre to the point; infinite where it lies behind the camera."""
    if points_in_camera(point, camera)[2] <= 0:
        return float("inf")
    x0, y0, x1, y1 = one.box
    return float(np.linalg.norm(project_points(point, camera) - np.array([(x0 + x1) / 2, (y0 + y1) / 2])))
