"""The track of a clip: when and where the object was, how fast, how large, and what it was taken for so far."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from aerojax.capture.format import Capture
from aerojax.core.types import CLASSES
from aerojax.geometry.geodesy import geographic
from aerojax.pipeline.offline import Clip

VELOCITY_REACH = 2
"""Frames before and after, of those that were used, over which the velocity is fitted."""
VELOCITY_REACH_S = 0.5
"""Seconds before and after beyond which frames do not count for it."""
SOLID = 0.1
"""Opacity below which a Gaussian is not part of the object's size."""
_TAIL = 0.01
"""Share of the Gaussians beyond each end of the size: single ones lie astray."""


@dataclass(frozen=True)
class TrackPoint:
    """The object in one frame.

    frame: number in the capture. time_s: seconds since its frame 0.
    position: of its centre, metres, world. velocity: metres a second, world; None where only one frame tells.
    size: length, width and height along its principal axes, metres, the longest first; None without Gaussians.
    probabilities: of the classes, from all frames so far.
    place: latitude and longitude (degrees) and height (metres), WGS 84; None where the capture has no origin.
    """

    frame: int
    time_s: float
    position: tuple[float, float, float]
    velocity: tuple[float, float, float] | None
    size: tuple[float, float, float] | None
    probabilities: dict[str, float]
    place: tuple[float, float, float] | None

    @property
    def label(self) -> str:
        """The likeliest class so far."""
        return max(self.probabilities, key=lambda name: self.probabilities[name])


def track_points(capture: Capture, clip: Clip) -> tuple[TrackPoint, ...]:
    """One point a frame that was used.

    Args:
        capture: what was classified.
        clip: of it, from a classifier.
    """
    assert clip.log_probabilities is not None  # there was a classifier
    times = np.array(clip.frames, np.float64) / capture.fps
    places = None if capture.origin is None else geographic(clip.position, capture.origin)
    means, opacity = np.asarray(clip.gaussians.mean, np.float64), np.asarray(clip.gaussians.opacity)
    so_far = np.exp(np.asarray(clip.log_probabilities, np.float64))
    return tuple(
        TrackPoint(
            frame=frame,
            time_s=float(times[i]),
            position=_triple(clip.position[i]),
            velocity=velocity_at(times, clip.position, i),
            size=size_of(means[i][opacity[i] > SOLID]),
            probabilities=dict(zip(CLASSES, so_far[i].tolist(), strict=True)),
            place=None if places is None else _triple(places[i]),
        )
        for i, frame in enumerate(clip.frames)
    )


def velocity_at(
    times: Float64[np.ndarray, "time"], positions: Float64[np.ndarray, "time 3"], index: int
) -> tuple[float, float, float] | None:
    """Slope of the least-squares line through the positions about one of them, metres a second."""
    first, last = max(0, index - VELOCITY_REACH), index + VELOCITY_REACH + 1
    near, places = times[first:last] - times[index], positions[first:last]
    close = np.abs(near) <= VELOCITY_REACH_S
    near, places = near[close], places[close]
    if len(near) < 2:
        return None
    centred = near - near.mean()
    return _triple(centred @ places / (centred @ centred))


def size_of(points: Float64[np.ndarray, "gaussian 3"]) -> tuple[float, float, float] | None:
    """Extents of a cloud along its principal axes, metres, the longest first."""
    if len(points) < 4:
        return None
    centred = points - points.mean(axis=0)
    axes = np.linalg.svd(centred, full_matrices=False)[2]
    low, high = np.quantile(centred @ axes.T, [_TAIL, 1 - _TAIL], axis=0)
    return _triple(np.sort(high - low)[::-1])


def _triple(values: Float64[np.ndarray, "3"]) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z
