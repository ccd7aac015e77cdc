"""What clocks, poses and paths should explain: residuals of sights and of what is thought beforehand, with derivatives.

Unknown are each path's spline and those of the cameras' clocks and poses that are looked for; known are the detections
that a track owns, each at the moment that its camera's clock and its row say. Sights are weighed down as they fit worse
(Cauchy's weights; Triggs et al. 2000, §3.3). Paths jerk at random, each as much as is likeliest (`stiffness`).

Shutters of one network are mostly of one make. What all share of their readout looks nearly as if the objects moved a
little differently, so it is known before to `readout_s`, and how one differs from the others to `readout_spread_s`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64
from scipy.sparse import block_diag, coo_array, csr_array, kron, vstack

from aerojax.track.adjust.corrections import (
    CLOCK,
    LINE,
    OFFSET_RATE,
    SHIFT,
    TURN,
    UNKNOWNS,
    Correction,
    corrected,
    difference,
)
from aerojax.track.adjust.splines import Knots
from aerojax.track.sights import TimedCamera, sight_of_points


@dataclass(frozen=True)
class AdjustConfig:
    """What is looked for, and what is thought of it before.

    clocks, line_delay, poses: whether offsets and rates, the shutters' line delays, and poses are looked for.
    search_s: how far offsets may be wrong; 0 looks for small errors alone.
    offset_s, rate, rotation_deg, position_m: standard deviations of errors, where there are any.
    readout_s: of the time in which all shutters roll over an image. readout_spread_s: of how one differs from others.
    knot_s: spacing of the paths' knots. jerk: of them, as in `MotionConfig`, to begin with.
    most_s: seconds of the recording, about its middle, that are used.
    outlier: standard deviations at which a detection counts half.
    steps: at most.
    """

    clocks: bool = True
    line_delay: bool = True
    poses: bool = True
    search_s: float = 0.3
    offset_s: float = 0.2
    rate: float = 1e-3
    readout_s: float = 0.02
    readout_spread_s: float = 0.002
    rotation_deg: float = 0.5
    position_m: float = 0.2
    knot_s: float = 0.2
    jerk: float = 30.0
    most_s: float = 120.0
    outlier: float = 3.0
    steps: int = 40


@dataclass(frozen=True, eq=False)
class Sights:
    """Detections of tracks, one a row. path: index of the track among those that are adjusted."""

    camera: Int64[np.ndarray, "sight"]
    stamp_s: Float64[np.ndarray, "sight"]
    row: Float64[np.ndarray, "sight"]
    pixels: Float64[np.ndarray, "sight 2"]
    sigma: Float64[np.ndarray, "sight"]
    path: Int64[np.ndarray, "sight"]


@dataclass(frozen=True, eq=False)
class Problem:
    """Sights of paths, the cameras as they are given, and each path's knots.

    jerks: of each path, m/s³. looked: which of the cameras' unknowns are looked for; others are as they are given.
    spread: by how much more what sights say varies than if each erred on its own.
    """

    sights: Sights
    given: tuple[TimedCamera, ...]
    knots: tuple[Knots, ...]
    jerks: tuple[float, ...]
    looked: Bool[np.ndarray, "camera 9"]
    config: AdjustConfig
    spread: float = 1.0

    @property
    def first_controls(self) -> list[int]:
        """The unknown at which each path's control points begin, and at last that at which the cameras begin."""
        return np.cumsum([0, *(3 * k.controls for k in self.knots)]).tolist()

    @property
    def unknowns(self) -> int:
        """Of paths and cameras."""
        return self.first_controls[-1] + UNKNOWNS * len(self.given)

    @property
    def free(self) -> Int64[np.ndarray, "free"]:
        """Unknowns that are looked for."""
        paths = self.first_controls[-1]
        return np.concatenate([np.arange(paths), paths + np.flatnonzero(self.looked)])


def lookable(config: AdjustConfig, cameras: int) -> Bool[np.ndarray, "camera 9"]:
    """What may be looked for; the first camera's clock is the network's."""
    found = np.zeros((cameras, UNKNOWNS), bool)
    found[1:, OFFSET_RATE] = config.clocks
    found[:, LINE] = config.line_delay
    found[:, TURN] = found[:, SHIFT] = config.poses
    return found


@dataclass(frozen=True, eq=False)
class Guess:
    """Cameras and control points of the paths."""

    cameras: tuple[TimedCamera, ...]
    controls: tuple[Float64[np.ndarray, "_ 3"], ...]

    def moved(self, problem: Problem, step: Float64[np.ndarray, "unknown"]) -> Guess:
        """After a step of all unknowns."""
        begins = problem.first_controls
        controls = tuple(own + step[begins[i] : begins[i + 1]].reshape(-1, 3) for i, own in enumerate(self.controls))
        none = np.zeros(UNKNOWNS)
        cameras = tuple(
            corrected(camera, Correction.of(values, none))
            for camera, values in zip(self.cameras, step[begins[-1] :].reshape(-1, UNKNOWNS), strict=True)
        )
        return Guess(cameras, controls)


@dataclass(frozen=True, eq=False)
class Linearised:
    """Residuals in standard deviations, their derivative by all unknowns, and the weight of each.

    cost: of the guess: Cauchy's for sights, squares for the rest; twice the negative logarithm of its probability.
    """

    off: Float64[np.ndarray, "row"]
    by_unknown: csr_array
    weight: Float64[np.ndarray, "row"]
    cost: float


def linearise(problem: Problem, guess: Guess) -> Linearised:
    """Residuals of sights and of what is thought beforehand."""
    off, by_unknown = _sight_rows(problem, guess)
    square = np.sum(off**2, axis=1)
    scale = problem.config.outlier**2
    weight = np.repeat(1 / (1 + square / scale), 2)
    before, by_before = _prior_rows(problem, guess)
    return Linearised(
        np.concatenate([off.ravel(), before]),
        csr_array(vstack([by_unknown, by_before])),
        np.concatenate([weight, np.ones(len(before))]),
        float(scale * np.sum(np.log1p(square / scale)) + np.sum(before**2)),
    )


def _sight_rows(problem: Problem, guess: Guess) -> tuple[Float64[np.ndarray, "sight 2"], coo_array]:
    """Expected minus observed pixels, and the derivative by all unknowns, in standard deviations."""
    sights, count = problem.sights, len(problem.sights.camera)
    points, velocity, first, weights = _on_paths(problem, guess)
    off, by_point, by_camera = np.zeros((count, 2)), np.zeros((count, 2, 3)), np.zeros((count, 2, UNKNOWNS))
    for index, camera in enumerate(guess.cameras):
        own = sights.camera == index
        pixels, derivative, _ = sight_of_points(points[own], camera)
        off[own], by_point[own] = pixels - sights.pixels[own], derivative
        by_camera[own] = _by_camera(camera, points[own], velocity[own], derivative, sights, own)
    scale = sights.sigma[:, None]
    by_controls = np.einsum("sia,sk->sika", by_point, weights).reshape(count, 2, 12)
    columns = np.concatenate(
        [
            first[:, None] + np.arange(12),
            problem.first_controls[-1] + UNKNOWNS * sights.camera[:, None] + np.arange(UNKNOWNS),
        ],
        axis=1,
    )
    values = np.concatenate([by_controls, by_camera], axis=2) / scale[..., None]
    rows = np.broadcast_to(np.arange(2 * count).reshape(count, 2, 1), values.shape)
    columns = np.broadcast_to(columns[:, None], values.shape)
    shape = (2 * count, problem.unknowns)
    return off / scale, coo_array((values.ravel(), (rows.ravel(), columns.ravel())), shape=shape)


def _on_paths(
    problem: Problem, guess: Guess
) -> tuple[
    Float64[np.ndarray, "sight 3"],
    Float64[np.ndarray, "sight 3"],
    Int64[np.ndarray, "sight"],
    Float64[np.ndarray, "sight 4"],
]:
    """Position and velocity at each sight's moment; the first unknown of its control points, and their weights."""
    sights, count = problem.sights, len(problem.sights.camera)
    times = np.zeros(count)
    for index, camera in enumerate(guess.cameras):
        own = sights.camera == index
        times[own] = camera.network_time(sights.stamp_s[own], sights.row[own])
    points, velocity = np.zeros((count, 3)), np.zeros((count, 3))
    first, weights = np.zeros(count, np.int64), np.zeros((count, 4))
    for index, (knots, controls) in enumerate(zip(problem.knots, guess.controls, strict=True)):
        own = sights.path == index
        begin, weights[own], slopes = knots.weights(times[own])
        near = controls[begin[:, None] + np.arange(4)]
        points[own] = np.einsum("sk,ska->sa", weights[own], near)
        velocity[own] = np.einsum("sk,ska->sa", slopes, near)
        first[own] = problem.first_controls[index] + 3 * begin
    return points, velocity, first, weights


def _by_camera(
    camera: TimedCamera,
    points: Float64[np.ndarray, "own 3"],
    velocity: Float64[np.ndarray, "own 3"],
    by_point: Float64[np.ndarray, "own 2 3"],
    sights: Sights,
    own: np.ndarray,
) -> Float64[np.ndarray, "own 2 9"]:
    """Derivatives of pixels by a camera's clock, rotation and position."""
    found = np.zeros((len(points), 2, UNKNOWNS))
    by_time = np.einsum("sia,sa->si", by_point, velocity)
    per_clock = np.stack([np.ones(len(points)), sights.stamp_s[own], sights.row[own] - camera.height / 2], axis=1)
    found[:, :, CLOCK] = by_time[:, :, None] * per_clock[:, None, :]
    # A point p of the camera's frame becomes p - w×p as the camera turns by w in its own axes; -w×p = p×w.
    rotation, centre = camera.world_from_cam[:3, :3], camera.world_from_cam[:3, 3]
    found[:, :, TURN] = by_point @ rotation @ crossing((points - centre) @ rotation)
    found[:, :, SHIFT] = -by_point
    return found


def crossing(vectors: Float64[np.ndarray, "vector 3"]) -> Float64[np.ndarray, "vector 3 3"]:
    """Matrices [v]× with [v]× u = v × u."""
    return np.cross(vectors[:, None, :], np.eye(3)[None]).swapaxes(1, 2)


def _prior_rows(problem: Problem, guess: Guess) -> tuple[Float64[np.ndarray, "row"], csr_array]:
    """Paths jerk by so much, and cameras are about as they are given."""
    blocks, off = [], []
    for knots, controls, jerk in zip(problem.knots, guess.controls, problem.jerks, strict=True):
        rows = knots.jerk_matrix() * (np.sqrt(knots.spacing_s) / jerk)
        blocks.append(csr_array(kron(rows, np.eye(3))))
        off.append((rows @ controls).ravel())
    none = np.zeros(UNKNOWNS)
    values = [difference(*pair, none).values() for pair in zip(problem.given, guess.cameras, strict=True)]
    rows = prior_matrix(problem.config, problem.given)
    return np.concatenate([*off, rows @ np.concatenate(values)]), csr_array(block_diag([*blocks, csr_array(rows)]))


def prior_matrix(config: AdjustConfig, cameras: Sequence[TimedCamera]) -> Float64[np.ndarray, "unknown unknown"]:
    """What makes corrections of all cameras numbers of mean 0, variance 1 and no correlation."""
    turn, shift = np.radians(config.rotation_deg), config.position_m
    scale = np.array([config.offset_s, config.rate, 1.0, turn, turn, turn, shift, shift, shift])
    rows = np.diag(np.tile(1 / scale, len(cameras)))
    lines = LINE + UNKNOWNS * np.arange(len(cameras))
    covariance = config.readout_s**2 + config.readout_spread_s**2 * np.eye(len(cameras))
    heights = np.array([camera.height for camera in cameras], np.float64)
    rows[np.ix_(lines, lines)] = np.linalg.inv(np.linalg.cholesky(covariance)) * heights
    return rows


def sight_distances(problem: Problem, guess: Guess) -> tuple[float, ...]:
    """Median distance of each camera's sights from where the guess has them, pixels; NaN without sights."""
    off = _sight_rows(problem, guess)[0] * problem.sights.sigma[:, None]
    far = np.linalg.norm(off, axis=1)
    own = [far[problem.sights.camera == index] for index in range(len(problem.given))]
    return tuple(float(np.median(one)) if len(one) else float("nan") for one in own)
