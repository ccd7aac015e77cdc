"""Several objects in synchronised frames: each silhouette is of at most one track."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from aerojax.capture.format import CaptureCamera
from aerojax.core.types import FrameSet, Silhouette, Track
from aerojax.track.base import TrackerConfig
from aerojax.track.following import Followed, FollowingConfig, FollowingState, end_round, follow_scan
from aerojax.track.sights import Scan, TimedCamera, sight_of_points, timed


@dataclass(frozen=True)
class SeveralConfig(TrackerConfig):
    """Several objects.

    following: when silhouettes are a track.
    """

    name: Literal["several"] = "several"
    following: FollowingConfig = field(default_factory=FollowingConfig)

    def build(self) -> SeveralTracker:
        """The member."""
        return SeveralTracker(self)


@dataclass(frozen=True, eq=False)
class SeveralState:
    """The cameras, whose images are undistorted, and what is followed."""

    cameras: tuple[TimedCamera, ...]
    following: FollowingState


@dataclass(frozen=True)
class SeveralTracker:
    """Tracks of whole silhouettes' middles; one that the border cuts goes to the track that is expected in its box."""

    config: SeveralConfig

    def initial(self, cameras: Sequence[CaptureCamera]) -> SeveralState:
        """Nothing seen yet."""
        straight = tuple(replace(timed(camera), distortion_model="none", distortion=()) for camera in cameras)
        return SeveralState(straight, FollowingState())

    def step(
        self, frames: FrameSet, silhouettes: Sequence[Silhouette], state: SeveralState
    ) -> tuple[list[Track], SeveralState]:
        """The objects that are believed and that a camera shows, by their numbers."""
        following, cameras = state.following, state.cameras
        for camera in range(len(cameras)):
            scan = self._scan(frames.time_s, camera, silhouettes)
            if len(scan.times):
                _, following = follow_scan(scan, following, cameras, self.config.following)
        if not following.heard:
            return [], state
        tracks, following = end_round(following, cameras, self.config.following)
        taken = {row for one in tracks for row in one.seen.values()}
        cut = [one for row, one in enumerate(silhouettes) if not one.whole and row not in taken]
        believed = sorted((one for one in tracks if one.number is not None and one.status != "lost"), key=_number)
        told = [_track(one, silhouettes, cut, cameras) for one in believed]
        return [one for one in told if any(one.silhouettes)], SeveralState(cameras, following)

    def _scan(self, time_s: float, camera: int, silhouettes: Sequence[Silhouette]) -> Scan:
        """The whole silhouettes of one camera."""
        rows = [row for row, one in enumerate(silhouettes) if one.camera == camera and one.whole]
        boxes = np.array([silhouettes[row].box for row in rows], np.float64).reshape(-1, 4)
        noise = self.config.following.noise
        diagonal = np.hypot(boxes[:, 2] - boxes[:, 0], boxes[:, 3] - boxes[:, 1])
        return Scan(
            camera=camera,
            time_s=time_s,
            times=np.full(len(rows), time_s),
            pixels=(boxes[:, :2] + boxes[:, 2:]) / 2,
            variance=noise.pixel**2 + (noise.outline * diagonal) ** 2,
            diagonal=diagonal,
            rows=np.array(rows, np.int64),
        )


def _number(one: Followed) -> int:
    assert one.number is not None  # those that are believed have one
    return one.number


def _track(
    one: Followed, silhouettes: Sequence[Silhouette], cut: list[Silhouette], cameras: Sequence[TimedCamera]
) -> Track:
    """With the silhouettes that it claimed, and what is cut by the border where it is expected."""
    held: list[Silhouette | None] = [None] * len(cameras)
    for camera, row in one.seen.items():
        held[camera] = silhouettes[row]
    for other in cut:
        if held[other.camera] is None and _inside(one, other, cameras[other.camera]):
            held[other.camera] = other
    return Track(_number(one), tuple(held), one.mean[:3], one.mean[3:6], one.covariance[:3, :3])


def _inside(one: Followed, silhouette: Silhouette, camera: TimedCamera) -> bool:
    """Whether a track is expected where a silhouette is, a border apart."""
    (u, v), _, depth = sight_of_points(one.mean[:3], camera)
    x0, y0, x1, y1 = silhouette.box
    margin = max(x1 - x0, y1 - y0) / 2
    return bool(depth > 0 and x0 - margin <= u <= x1 + margin and y0 - margin <= v <= y1 + margin)
