"""Roughly how far cameras' clocks are apart: the offsets with which their paths lie in common epipolar planes.

For two cameras and an offset, a path in one of them is looked up at the moments of the other's detections; where the
clocks agree, both rays lie in one plane with the line between the cameras (Caspi & Irani 2002; Albl et al. 2017). No
object needs to be known in space, so this works where tracking does not yet.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from aerojax.track.adjust.tracklets import tracklets
from aerojax.track.association import directions
from aerojax.track.sights import Detections, TimedCamera, network_times, undistorted

STEP_S = 0.01
"""Between offsets that are tried; the adjustment converges from several times as far."""
AGREE_RAD = 0.003
"""Angle from the epipolar plane at which a pair counts half: a few pixels of a usual lens."""
WINDOW_S = 30.0
"""Of the recording, about its middle; a rate that is wrong by 0.1 % moves by half as many milliseconds in it."""
_MOST_MOMENTS = 400
"""Of a camera that are looked up in another one."""
_SWEEPS = 10
_WORTH_A_CHANGE = 1.1
"""Offsets that agree no better than this many times the given ones change nothing; the adjustment does the rest."""

Curve = Float64[np.ndarray, "offset"]


@dataclass(frozen=True, eq=False)
class _Path:
    """Rays of one piece of path: seconds by the clock as it is given, unit directions, world."""

    times: Float64[np.ndarray, "sight"]
    rays: Float64[np.ndarray, "sight 3"]


def search_offsets(
    detections: Detections, cameras: Sequence[TimedCamera], reach_s: float
) -> Float64[np.ndarray, "camera"]:
    """What to add to the cameras' `time_offset_s`, to about `STEP_S`, the first camera's being right.

    Args:
        detections: of the network.
        cameras: with the clocks that are given.
        reach_s: how far the offsets may be wrong.
    """
    tried = STEP_S * np.arange(-np.ceil(2 * reach_s / STEP_S), np.ceil(2 * reach_s / STEP_S) + 1)
    paths = [_paths(detections, cameras, index) for index in range(len(cameras))]
    curves: dict[tuple[int, int], Curve] = {}
    for i, j in itertools.combinations(range(len(cameras)), 2):
        base = cameras[j].world_from_cam[:3, 3] - cameras[i].world_from_cam[:3, 3]
        curves[i, j] = _agreement(paths[i], paths[j], base, tried)
        curves[j, i] = curves[i, j][::-1]
    return _best(curves, len(cameras), tried, reach_s)


def _paths(detections: Detections, cameras: Sequence[TimedCamera], index: int) -> list[_Path]:
    own = detections.chosen(detections.camera == index)
    if len(own.camera) == 0:
        return []
    times, pixels = network_times(own, cameras), undistorted(own, cameras)
    near = np.abs(times - np.median(times)) <= WINDOW_S / 2
    times, pixels, stamps = times[near], pixels[near], own.stamp_s[near]
    return [_Path(times[rows], directions(pixels[rows], cameras[index])) for rows in tracklets(stamps, pixels)]


def _agreement(ours: list[_Path], theirs: list[_Path], base: Float64[np.ndarray, "3"], tried: Curve) -> Curve:
    """For each offset of their clock against ours, how many of our rays meet one of theirs, about 0 to 1 each."""
    if not ours or not theirs:
        return np.zeros(len(tried))
    times, rays = (np.concatenate([getattr(path, name) for path in ours]) for name in ("times", "rays"))
    chosen = np.unique(np.linspace(0, len(times) - 1, _MOST_MOMENTS).astype(int))
    times, rays = times[chosen], rays[chosen]
    normal = np.cross(base, rays)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    worth = np.zeros((len(tried), len(times)))
    moments = times[None, :] - tried[:, None]  # by their clock as given
    for path in theirs:
        out = np.zeros(moments.shape)
        for axis in range(3):
            seen = np.interp(moments, path.times, path.rays[:, axis], left=np.nan, right=np.nan)
            out += normal[None, :, axis] * seen
        worth = np.fmax(worth, 1 / (1 + (out / AGREE_RAD) ** 2))
    return worth.sum(axis=1)


def _best(
    curves: dict[tuple[int, int], Curve], count: int, tried: Curve, reach_s: float
) -> Float64[np.ndarray, "camera"]:
    """Offsets that together agree best: each in turn the best beside the others, until none changes."""
    middle = len(tried) // 2
    allowed = np.flatnonzero(np.abs(tried) <= reach_s + STEP_S / 2)
    no_reason = 1e-6 * np.abs(tried[allowed])  # to change anything, where all are equal
    found = np.full(count, middle)
    for one in range(1, count):
        found[one] = allowed[np.argmax(curves[0, one][allowed] - no_reason)]
    for _ in range(_SWEEPS):
        before = found.copy()
        for one in range(1, count):
            total = -no_reason
            for other in range(count):
                if other != one:
                    total = total + _at(curves[other, one], middle + allowed - found[other])
            found[one] = allowed[np.argmax(total)]
        if np.array_equal(before, found):
            break
    as_given = np.full(count, middle)
    if _total(curves, found, middle) < _WORTH_A_CHANGE * _total(curves, as_given, middle):
        return np.zeros(count)
    return tried[found]


def _at(curve: Curve, places: Int64[np.ndarray, "place"]) -> Float64[np.ndarray, "place"]:
    return curve[np.clip(places, 0, len(curve) - 1)]


def _total(curves: dict[tuple[int, int], Curve], found: Int64[np.ndarray, "camera"], middle: int) -> float:
    """Agreement of all pairs with these offsets."""
    return float(sum(_at(curve, middle + found[[j]] - found[i])[0] for (i, j), curve in curves.items()))
