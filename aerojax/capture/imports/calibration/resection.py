"""Poses of cameras from one moving object: where it was, from its own navigation, and where a camera saw it.

Each camera is resected by itself (perspective-n-point) in the frame of the track, with the delay of the track's clock
found by the smallest error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float64

from aerojax.capture.imports.calibration.base import transform_of
from aerojax.capture.lenses import undistort_points
from aerojax.core.errors import UserError
from aerojax.geometry.cameras import invert_rigid

_FEWEST = 12
"""Detections of a camera; six unknowns, and some to see by that they are right."""
_MOST = 400
"""Detections of a camera that are used, spread evenly over time."""
_INLIER_PX = 12.0


@dataclass(frozen=True, eq=False)
class Sightings:
    """What one camera saw of the object.

    time_s: on the network's clock, ascending. pixels: in the stored image, its centre pixel convention the house's.
    K, distortion_model, distortion: of the camera.
    """

    name: str
    time_s: Float64[np.ndarray, "sight"]
    pixels: Float64[np.ndarray, "sight 2"]
    K: Float64[np.ndarray, "3 3"]
    distortion_model: str
    distortion: tuple[float, ...]

    def thinned(self) -> Sightings:
        """At most `_MOST` of them, undistorted."""
        chosen = np.unique(np.linspace(0, len(self.time_s) - 1, _MOST).astype(int))
        straight = undistort_points(self.pixels[chosen], self.K, self.distortion_model, self.distortion)
        return Sightings(self.name, self.time_s[chosen], straight, self.K, "none", ())


@dataclass(frozen=True, eq=False)
class Track:
    """Positions of the object, metres, +Z up, at a fixed rate from some moment of the network's clock on."""

    positions: Float64[np.ndarray, "time 3"]
    rate: float

    def at(self, time_s: Float64[np.ndarray, "sight"]) -> Float64[np.ndarray, "sight 3"]:
        """Positions at seconds since its first one, NaN before and after it."""
        known = np.arange(len(self.positions)) / self.rate
        columns = [np.interp(time_s, known, axis, left=np.nan, right=np.nan) for axis in self.positions.T]
        return np.stack(columns, axis=-1)


@dataclass(frozen=True, eq=False)
class Resection:
    """Poses by camera; delay_s: of the track's beginning on the network's clock; error_px: median of each camera."""

    world_from_cam: dict[str, Float64[np.ndarray, "4 4"]]
    delay_s: float
    error_px: dict[str, float]


def resect(sightings: Sequence[Sightings], track: Track, delay_s: float | None) -> Resection:
    """Poses of all cameras in the track's frame.

    Args:
        sightings: of each camera.
        track: of the object.
        delay_s: of the track's first position on the network's clock; searched for if None.

    Raises:
        UserError: a camera has too few sightings, or no pose that explains them.
    """
    thinned = [one.thinned() for one in sightings]
    delay_s = _search(thinned, track) if delay_s is None else delay_s
    poses, errors = {}, {}
    for one in thinned:
        pose, error = _pose(one, track, delay_s)
        if pose is None:
            raise UserError(
                "mismatch",
                f"camera {one.name}: no pose explains its {len(one.time_s)} sightings of the track",
                "check corresponding_frames, fps and the lens, or set calibration.delay_s",
            )
        poses[one.name], errors[one.name] = pose, error
    return Resection(poses, delay_s, errors)


def _search(sightings: Sequence[Sightings], track: Track) -> float:
    """The delay with the smallest error: every half period of the track first, then finer."""
    seen_from = min(float(one.time_s[0]) for one in sightings)
    seen_to = max(float(one.time_s[-1]) for one in sightings)
    length = (len(track.positions) - 1) / track.rate
    best, step = seen_from, 0.5 / track.rate
    candidates = np.arange(min(seen_from, seen_to - length), max(seen_from, seen_to - length) + step / 2, step)
    for _ in range(6):
        costs = [_cost(sightings, track, float(delay)) for delay in candidates]
        best = float(candidates[int(np.argmin(costs))])
        candidates, step = best + step * np.linspace(-1, 1, 9), step / 4
    return best


def _cost(sightings: Sequence[Sightings], track: Track, delay_s: float) -> float:
    return float(np.mean([_pose(one, track, delay_s)[1] for one in sightings]))


def _pose(one: Sightings, track: Track, delay_s: float) -> tuple[Float64[np.ndarray, "4 4"] | None, float]:
    """world_from_cam and the median error in pixels; None and a large error where there is no pose."""
    points = track.at(one.time_s - delay_s)
    known = np.isfinite(points).all(axis=1)
    if np.count_nonzero(known) < max(_FEWEST, 0.3 * len(points)):
        return None, 1e6
    points, pixels = points[known], one.pixels[known] - 0.5
    K = one.K.copy()
    K[:2, 2] -= 0.5
    middle = points.mean(axis=0)  # far from the origin of a track, PnP loses digits
    cv2.setRNGSeed(0)
    found, turn, moved, _ = cv2.solvePnPRansac(
        points - middle, pixels, K, None, reprojectionError=_INLIER_PX, iterationsCount=200, flags=cv2.SOLVEPNP_EPNP
    )
    if not found:
        return None, 1e6
    turn, moved = cv2.solvePnPRefineLM(points - middle, pixels, K, None, turn, moved)
    seen = cv2.projectPoints(points - middle, turn, moved, K, None)[0][:, 0]
    error = float(np.median(np.linalg.norm(seen - pixels, axis=1)))
    cam_from_middle = transform_of(
        np.asarray(cv2.Rodrigues(turn)[0], np.float64), np.asarray(moved, np.float64).ravel()
    )
    world_from_cam = invert_rigid(cam_from_middle)
    world_from_cam[:3, 3] += middle
    return world_from_cam, error
