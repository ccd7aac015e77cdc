"""How things move that do not fly by themselves: thrown, carried by the wind, fluttering down, on a line, spinning.

Kinematics as in `flight`: smooth paths and attitudes that look like the real ones, not solutions of their dynamics.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from aerojax.simulate.assets.outliers.kinds import KINDS, Drift
from aerojax.simulate.world.flight import GRAVITY, Flight, Motion, draw_flight, fitting, wobble

_Path = Float[np.ndarray, "time 3"]
_Moved = tuple[_Path, Rotation]


def draw_motion(
    what: str, *, frames: int, fps: float, motion: Motion, rng: np.random.Generator, max_travel: float = 7.0
) -> Flight:
    """`draw_flight` for a class, and the like for a kind of outlier.

    Args:
        what: one of `CLASSES`, or of `outliers.kinds.KINDS`. With `motion` `in_place` an outlier stays at the origin
            and turns as it does otherwise.
        frames, fps, motion, rng, max_travel: as for `draw_flight`.
    """
    if what not in KINDS:
        return draw_flight(what, frames=frames, fps=fps, motion=motion, rng=rng, max_travel=max_travel)
    seconds = (np.arange(frames) - (frames - 1) / 2) / fps
    path, attitude = _DRIFTS[KINDS[what].drift](seconds, rng)
    path = (path - path[len(path) // 2]) * fitting(path, max_travel) * (motion == "flight")
    return Flight(path, attitude.as_matrix())


def _wind(seconds: np.ndarray, rng: np.random.Generator, speed: tuple[float, float]) -> _Path:
    """A steady horizontal velocity."""
    heading, metres = rng.uniform(0, 2 * np.pi), rng.uniform(*speed)
    return seconds[:, None] * metres * np.array([np.cos(heading), np.sin(heading), 0.0])


def _sway(seconds: np.ndarray, rng: np.random.Generator, metres: float) -> _Path:
    return np.stack([wobble(seconds, rng, amplitude=metres) for _ in range(3)], axis=1)


def _tumbling(seconds: np.ndarray, rng: np.random.Generator, most: float) -> Rotation:
    """A steady turn about any axis, up to `most` radians a second, from any attitude."""
    axis = rng.normal(0.0, 1.0, 3)
    rate = axis / np.linalg.norm(axis) * rng.uniform(0.0, most)
    return Rotation.from_rotvec(seconds[:, None] * rate) * Rotation.random(random_state=rng)


def _upright(seconds: np.ndarray, rng: np.random.Generator, lean_deg: float, turn: float) -> Rotation:
    """Slowly turning about +Z, leaning by about so many degrees."""
    yaw = rng.uniform(0, 2 * np.pi) + rng.uniform(-turn, turn) * seconds
    lean = np.deg2rad(lean_deg)
    pitch, roll = (rng.normal(0.0, lean) + wobble(seconds, rng, amplitude=lean) for _ in range(2))
    return Rotation.from_euler("ZYX", np.stack([yaw, pitch, roll], axis=1))


def _thrown(seconds: np.ndarray, rng: np.random.Generator) -> _Moved:
    """A ballistic path; one in two bounces on ground that it reaches within the clip."""
    path = _wind(seconds, rng, (1.0, 7.0))
    rise = rng.uniform(-3.0, 3.0)
    height = rise * seconds - 0.5 * GRAVITY * seconds**2
    if rng.uniform() < 0.5:
        # Parabolas between contacts of equal strength, as of a ball that loses little.
        up = rng.uniform(1.5, 5.0)
        since = (seconds + rng.uniform(0, 2 * up / GRAVITY)) % (2 * up / GRAVITY)
        height = up * since - 0.5 * GRAVITY * since**2
    path[:, 2] = height
    return path, _tumbling(seconds, rng, 12.0)


def _drifting(seconds: np.ndarray, rng: np.random.Generator) -> _Moved:
    """With the wind, rising or sinking slowly; one in four turns over."""
    path = _wind(seconds, rng, (0.2, 5.0)) + _sway(seconds, rng, rng.uniform(0.02, 0.3))
    path[:, 2] += rng.uniform(-0.8, 1.5) * seconds
    if rng.uniform() < 0.25:
        return path, _tumbling(seconds, rng, 3.0)
    return path, _upright(seconds, rng, rng.uniform(2.0, 15.0), 1.0)


def _fluttering(seconds: np.ndarray, rng: np.random.Generator) -> _Moved:
    """Swinging from side to side on its way down, or tumbling (Belmonte, Eisenberg & Moses 1998)."""
    path = _wind(seconds, rng, (0.0, 3.0))
    path[:, 2] = -rng.uniform(0.6, 2.0) * seconds
    if rng.uniform() < 0.4:
        return path + _sway(seconds, rng, 0.1), _tumbling(seconds, rng, 15.0)
    heading, phase = rng.uniform(0, 2 * np.pi, 2)
    swing = 2 * np.pi * rng.uniform(0.8, 2.5) * seconds + phase
    reach, angle = rng.uniform(0.1, 0.5), np.deg2rad(rng.uniform(20.0, 70.0))
    path = path + reach * np.sin(swing)[:, None] * np.array([np.cos(heading), np.sin(heading), 0.0])
    yaw = heading + rng.uniform(-2.0, 2.0) * seconds
    rock = np.stack([yaw, angle * np.cos(swing), wobble(seconds, rng, amplitude=0.3)], axis=1)
    return path, Rotation.from_euler("ZYX", rock)


def _tethered(seconds: np.ndarray, rng: np.random.Generator) -> _Moved:
    """Held by a line: swaying in its place, the nose up against the wind."""
    path = _sway(seconds, rng, rng.uniform(0.05, 0.6))
    yaw = rng.uniform(0, 2 * np.pi) + wobble(seconds, rng, amplitude=0.2)
    pitch = -np.deg2rad(rng.uniform(20.0, 70.0)) + wobble(seconds, rng, amplitude=0.1)
    return path, Rotation.from_euler("ZYX", np.stack([yaw, pitch, wobble(seconds, rng, amplitude=0.25)], axis=1))


def _spinning(seconds: np.ndarray, rng: np.random.Generator) -> _Moved:
    """Gliding and spinning about its own upright axis, banked."""
    path = _wind(seconds, rng, (3.0, 9.0))
    path[:, 2] = rng.uniform(-1.0, 1.0) * seconds - rng.uniform(0.0, 1.0) * seconds**2
    tilt = np.deg2rad(rng.normal(0.0, 15.0, 2))
    lean = Rotation.from_euler("YX", tilt)
    return path, lean * Rotation.from_rotvec(seconds[:, None] * np.array([0.0, 0.0, rng.uniform(10.0, 50.0)]))


_DRIFTS: dict[Drift, Callable[[np.ndarray, np.random.Generator], _Moved]] = {
    "thrown": _thrown,
    "drifting": _drifting,
    "fluttering": _fluttering,
    "tethered": _tethered,
    "spinning": _spinning,
}
