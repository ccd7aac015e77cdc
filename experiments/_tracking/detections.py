"""Rows of detections without images: tracks, clocks that are wrong, and a camera that was moved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
from jaxtyping import Float64

from aerojax.evaluate.tracking import tracking_figures
from aerojax.track.adjust.corrections import UNKNOWNS, Correction, corrected, difference
from aerojax.track.adjust.outlines import Outlines
from aerojax.track.adjust.problem import AdjustConfig
from aerojax.track.adjust.recording import adjust_recording
from aerojax.track.following import FollowingConfig
from aerojax.track.offline import follow
from aerojax.track.sights import Detections, TimedCamera
from aerojax.track.simulated import Watched, watch
from experiments._tracking.bounds import clock_bounds
from experiments._tracking.flown import Flown, FlownConfig, beside_paths

Row = dict[str, Any]
OFFSET_S = 5e-3
"""To which offsets of clocks shall be known."""


@dataclass(frozen=True)
class ErrorsConfig:
    """How wrong cameras are.

    offset_s: of each clock but the first camera's, uniformly up to it. rate: of each but the first one's, either way.
    readout_s: in which every shutter rolls over an image; nobody is told.
    rotation_deg, position_m: of one camera, about or along a random axis: the first in odd scenes, the other in even.
    """

    offset_s: float = 0.2
    rate: float = 1e-3
    readout_s: float = 0.02
    rotation_deg: float = 0.5
    position_m: float = 0.2


@dataclass(frozen=True)
class MeasuredConfig:
    """How objects are followed, what is wrong with the cameras, and how that is looked for.

    following: when sights are a track. errors: of the cameras. adjust: what is looked for.
    """

    following: FollowingConfig = field(default_factory=FollowingConfig)
    errors: ErrorsConfig = field(default_factory=ErrorsConfig)
    adjust: AdjustConfig = field(default_factory=AdjustConfig)


def tracks_row(scene: Flown, config: FlownConfig, measured: MeasuredConfig, *, stagger: bool) -> Row:
    """Tracks of cameras whose clocks are known; `stagger` lets each take its images at a phase of its own."""
    seen = _seen(scene, scene.cameras, config, stagger=stagger)
    return _figures(scene, seen, scene.cameras, measured)


def clocks_row(scene: Flown, config: FlownConfig, measured: MeasuredConfig) -> Row:
    """Clocks that are wrong and shutters that roll: tracks with them, with what is found, and with the truth.

    Offsets are compared in the middle of the recording, for the middle row. offset_sigma_ms: what is reported of the
    least certain camera. offset_bound_ms: of it, what nobody could do better who knew which sight is whose.
    determined: cameras whose offset is reported as known to 5 ms (two standard deviations); of them, determined_right
    are.
    """
    errors, rng = measured.errors, scene.rng
    true = tuple(_with_clock(camera, index, errors, rng) for index, camera in enumerate(scene.cameras))
    watched = _watched(scene, true, config, stagger=True)
    adjusted = adjust_recording(watched.detections, scene.cameras, measured.following, measured.adjust)
    found = adjusted.apply(scene.cameras)
    length = config.frames / config.fps
    ends = [np.abs(_moments(found, moment) - _moments(true, moment)) for moment in (0.0, length / 2, length)]
    sigma = np.array([one.sigma_s for one in adjusted.middles])
    bound = clock_bounds(scene.paths, true, watched, measured.adjust, length / 2)
    sure = (2 * sigma <= OFFSET_S)[1:]
    pair = (("given", scene.cameras), ("perfect", true))
    rows = {name: _figures(scene, watched.detections, c, measured) for name, c in pair}
    ours = _figures(scene, watched.detections, found, measured)
    return {
        "offset_error_ms": 1e3 * float(ends[1].max()),
        "offset_sigma_ms": 1e3 * float(sigma.max()),
        "offset_bound_ms": 1e3 * float(bound.max()),
        "offset_over_sigma": _root_mean_square(ends[1][1:] / sigma[1:]),
        "offset_error_ends_ms": 1e3 * float(max(ends[0].max(), ends[2].max())),
        "determined": int(sure.sum()),
        "determined_right": int(np.sum(ends[1][1:][sure] <= OFFSET_S)),
        "offsets_right": int(np.sum(ends[1][1:] <= OFFSET_S)),
        "clocks": len(true) - 1,
        "rmse_ratio": ours["rmse"] / rows["perfect"]["rmse"],
        **ours,
        **rows,
    }


def poses_row(scene: Flown, config: FlownConfig, measured: MeasuredConfig, number: int) -> Row:
    """One camera that is wrong: how far from the truth the cameras are that are found."""
    which, what, given = with_wrong_pose(scene.cameras, number, measured.errors, scene.rng)
    seen = _seen(scene, scene.cameras, config, stagger=False)
    _, errors = recovered(seen, given, scene.cameras, measured)
    return {"camera": which, "wrong": what, **errors}


def recovered(
    seen: Detections,
    given: Sequence[TimedCamera],
    true: Sequence[TimedCamera],
    measured: MeasuredConfig,
    *,
    outlines: Outlines | None = None,
) -> tuple[tuple[TimedCamera, ...], Row]:
    """The cameras that are found, and how far the worst of them is from the truth; clocks are known.

    off_px and then_px: by how much the worst camera's sights are off the paths, as it is given and as it is found.
    changed: cameras that are corrected. pose_over_sigma: of what is corrected, the error over what is reported of it.
    """
    only_poses = replace(measured.adjust, clocks=False, line_delay=False)
    adjusted = adjust_recording(seen, given, measured.following, only_poses, outlines=outlines)
    found = adjusted.apply(given)
    off = [difference(f, t, np.zeros(UNKNOWNS)) for f, t in zip(found, true, strict=True)]
    angles, distances = [one.angle_deg for one in off], [one.distance_m for one in off]
    pixels = {"off_px": float(np.nanmax(adjusted.before_px)), "then_px": float(np.nanmax(adjusted.after_px))}
    values, sigma = (np.stack([row(one) for one in adjusted.corrections]) for row in (Correction.values, _sigma))
    left = np.stack([one.values() for one in off])[values != 0] / sigma[values != 0]
    more = {"changed": int(np.any(values != 0, axis=1).sum()), "pose_over_sigma": _root_mean_square(left)}
    return found, {"rotation_error_deg": max(angles), "position_error_m": max(distances), **pixels, **more}


def _sigma(one: Correction) -> Float64[np.ndarray, "9"]:
    return one.sigma


def _root_mean_square(values: Float64[np.ndarray, "_"]) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0


def with_wrong_pose(
    cameras: Sequence[TimedCamera], number: int, errors: ErrorsConfig, rng: np.random.Generator
) -> tuple[int, str, tuple[TimedCamera, ...]]:
    """Which camera is wrong, in what, and all of them."""
    which, axis = int(rng.integers(len(cameras))), rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    turned = number % 2 == 1
    turn, shift = np.radians(errors.rotation_deg) * axis * turned, errors.position_m * axis * (not turned)
    wrong = corrected(cameras[which], Correction(0.0, 0.0, 0.0, turn, shift, np.zeros(UNKNOWNS)))
    return which, "rotation" if turned else "position", (*cameras[:which], wrong, *cameras[which + 1 :])


def _with_clock(camera: TimedCamera, index: int, errors: ErrorsConfig, rng: np.random.Generator) -> TimedCamera:
    offset, sign = rng.uniform(-errors.offset_s, errors.offset_s), rng.choice([-1.0, 1.0])
    line = errors.readout_s / camera.height
    if index == 0:  # its clock is the network's
        return replace(camera, line_delay_s=line)
    return replace(camera, time_offset_s=float(offset), clock_rate=float(1 + sign * errors.rate), line_delay_s=line)


def _moments(cameras: Sequence[TimedCamera], stamp_s: float) -> Float64[np.ndarray, "camera"]:
    """When each camera took its middle row of this stamp."""
    return np.array([c.network_time(np.array([stamp_s]), np.array([c.height / 2]))[0] for c in cameras])


def _seen(scene: Flown, cameras: Sequence[TimedCamera], config: FlownConfig, *, stagger: bool) -> Detections:
    return _watched(scene, cameras, config, stagger=stagger).detections


def _watched(scene: Flown, cameras: Sequence[TimedCamera], config: FlownConfig, *, stagger: bool) -> Watched:
    how = {"frames": config.frames, "fps": config.fps, "config": config.detector, "stagger": stagger, "rng": scene.rng}
    return watch(scene.paths, cameras, **how)


def _figures(scene: Flown, seen: Detections, cameras: Sequence[TimedCamera], measured: MeasuredConfig) -> Row:
    followed = follow(seen, cameras, measured.following)
    return asdict(tracking_figures(beside_paths(followed, scene.paths)))
