"""Class-typical 6-DoF flight of the body frame (nose +X, up +Z), keyframed at the capture's frame rate. Host-side.

Kinematics, not dynamics: a smooth path is drawn and the attitude that would fly it follows. A multicopter's lift is
along its up axis, so it tilts by atan(a/g); airplanes and birds bank by tan φ = v²/(g r) (stage-0 facts, [L]).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation, Slerp

GRAVITY = 9.81
Motion = Literal["in_place", "flight"]


@dataclass(frozen=True)
class Flight:
    """Poses of the body, one a frame: position (metres, world) and rotation `world_from_body`."""

    position: Float[np.ndarray, "time 3"]
    world_from_body: Float[np.ndarray, "time 3 3"]

    def transforms(self) -> Float[np.ndarray, "time 4 4"]:
        """Rigid `world_from_body`, metres."""
        poses = np.tile(np.eye(4), (len(self.position), 1, 1))
        poses[:, :3, :3], poses[:, :3, 3] = self.world_from_body, self.position
        return poses

    def transform_at(self, index: float) -> Float[np.ndarray, "4 4"]:
        """Rigid `world_from_body` at an index that need not be whole, the ends' beyond them.

        Straight between positions, shortest between attitudes.
        """
        last = len(self.position) - 1
        index = float(np.clip(index, 0.0, last))
        before = min(int(index), max(last - 1, 0))
        share, after = index - before, min(before + 1, last)
        pose = np.eye(4)
        pose[:3, 3] = (1 - share) * self.position[before] + share * self.position[after]
        pose[:3, :3] = self.world_from_body[before]
        if share > 0:
            ends = Rotation.from_matrix(self.world_from_body[[before, after]])
            pose[:3, :3] = Slerp([0.0, 1.0], ends)(share).as_matrix()
        return pose

    def within(self, first: int, count: int) -> Flight:
        """The part of `count` frames from `first` on."""
        part = slice(first, first + count)
        return Flight(self.position[part], self.world_from_body[part])


@dataclass(frozen=True)
class _Style:
    """Ranges of a class: speed (m/s), bank limit and pitch (degrees), rate of turn (rad/s), climb angle (degrees)."""

    speed: tuple[float, float]
    bank_limit: float
    pitch: tuple[float, float]
    turn: float
    climb: float


_FORWARD = {
    "bird": _Style(speed=(3.0, 9.0), bank_limit=55.0, pitch=(-8.0, 10.0), turn=0.9, climb=15.0),
    "airplane": _Style(speed=(5.0, 11.0), bank_limit=45.0, pitch=(-4.0, 6.0), turn=0.5, climb=10.0),
    "helicopter": _Style(speed=(0.0, 6.0), bank_limit=20.0, pitch=(-12.0, 2.0), turn=0.7, climb=10.0),
}


def draw_flight(
    label: str, *, frames: int, fps: float, motion: Motion, rng: np.random.Generator, max_travel: float = 7.0
) -> Flight:
    """Draw a flight whose middle frame is at the origin.

    Args:
        label: one of `CLASSES`.
        frames, fps: length and rate.
        motion: `in_place` holds one heading at the origin with an elevation within ±20° (the published Sim-1);
            `flight` moves as the class does.
        rng: source of every draw.
        max_travel: metres that the whole path may span; a longer one is flown more slowly to fit the monitored volume,
            with the attitude that belongs to the slower flight.
    """
    seconds = (np.arange(frames) - (frames - 1) / 2) / fps
    if motion == "in_place":
        heading, elevation = rng.uniform(0, 2 * np.pi), np.deg2rad(rng.uniform(-20, 20))
        attitude = _attitude(np.array([heading]), np.array([-elevation]), np.zeros(1))
        return Flight(np.zeros((frames, 3)), np.repeat(attitude, frames, axis=0))
    if label == "drone":
        return _hover(seconds, rng, max_travel)
    return _forward(_FORWARD[label], label, seconds, rng, max_travel)


def fitting(path: Float[np.ndarray, "time 3"], max_travel: float) -> float:
    """The factor that makes a path span no more than `max_travel`."""
    span = float(np.linalg.norm(np.ptp(path, axis=0)))
    return min(1.0, max_travel / max(span, 1e-9))


def _attitude(
    yaw: Float[np.ndarray, "time"], pitch: Float[np.ndarray, "time"], roll: Float[np.ndarray, "time"]
) -> Float[np.ndarray, "time 3 3"]:
    """R = Rz(yaw) Ry(pitch) Rx(roll), radians; positive pitch is nose down in this right-handed, Z-up frame."""
    cy, sy, cp, sp, cr, sr = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch), np.cos(roll), np.sin(roll)
    rows = (
        (cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
        (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
        (-sp, cp * sr, cp * cr),
    )
    return np.moveaxis(np.array([[*row] for row in rows]), -1, 0)


def wobble(seconds: np.ndarray, rng: np.random.Generator, *, amplitude: float, terms: int = 3) -> np.ndarray:
    """A smooth band-limited disturbance (0.3 to 2.5 Hz) of about the given amplitude."""
    frequency, phase = rng.uniform(0.3, 2.5, terms), rng.uniform(0, 2 * np.pi, terms)
    weight = rng.normal(0, amplitude / np.sqrt(terms), terms)
    return np.sin(2 * np.pi * seconds[:, None] * frequency + phase) @ weight


def _smooth_step(x: np.ndarray) -> np.ndarray:
    """0 before 0, 1 after 1, with no jump in slope: 3x² - 2x³."""
    x = np.clip(x, 0.0, 1.0)
    return x * x * (3 - 2 * x)


def _turn_rate(style: _Style, seconds: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Rate of turn in rad/s: one arc, and in a flight of more than two seconds a change to another one."""
    turn = rng.uniform(-style.turn, style.turn)
    rate = np.full_like(seconds, turn)
    if seconds[-1] - seconds[0] > 2.0:
        begin, length = rng.uniform(seconds[0], seconds[-1]), rng.uniform(0.8, 1.6)
        rate += (rng.uniform(-style.turn, style.turn) - turn) * _smooth_step((seconds - begin) / length)
    return rate


def _forward(style: _Style, label: str, seconds: np.ndarray, rng: np.random.Generator, max_travel: float) -> Flight:
    """Birds, airplanes and helicopters: arcs with the bank that belongs to them."""
    speed = rng.uniform(*style.speed)
    step = seconds[1] - seconds[0] if len(seconds) > 1 else 0.0
    rate = _turn_rate(style, seconds, rng)
    turned = np.cumsum(rate) * step
    sway = 0.15 * wobble(seconds, rng, amplitude=float(np.abs(rate).max()))
    yaw = rng.uniform(0, 2 * np.pi) + turned - turned[len(turned) // 2] + sway
    climb = np.deg2rad(rng.uniform(-style.climb, style.climb))
    direction = [np.cos(climb) * np.cos(yaw), np.cos(climb) * np.sin(yaw), np.full_like(yaw, np.sin(climb))]
    path = np.cumsum(speed * np.stack(direction, axis=1), axis=0) * step
    shrink = fitting(path, max_travel)
    position = (path - path[len(path) // 2]) * shrink
    limit = np.deg2rad(style.bank_limit)
    bank = np.clip(np.arctan(speed * shrink * rate / GRAVITY), -limit, limit)
    roll = -bank + wobble(seconds, rng, amplitude=np.deg2rad(3.0))
    pitch = -climb - np.deg2rad(rng.uniform(*style.pitch)) + wobble(seconds, rng, amplitude=np.deg2rad(2.0))
    if label == "helicopter":
        # Pedal turns: the nose need not point along the path at low speed.
        yaw = yaw + (1 - speed / style.speed[1]) * (rng.uniform(-np.pi, np.pi) + rng.uniform(-1.0, 1.0) * seconds)
    return Flight(position, _attitude(yaw, pitch, roll))


def _dashes(seconds: np.ndarray, rng: np.random.Generator) -> Float[np.ndarray, "time 3"]:
    """Path of a multicopter that starts, stops and turns sharply: its velocity changes now and then within a second."""
    velocity = np.zeros((len(seconds), 3)) + rng.uniform(-3.0, 3.0, 3) * np.array([1.0, 1.0, 0.3])
    length = seconds[-1] - seconds[0]
    for _ in range(1 + rng.poisson(0.8 * length)):
        begin, lasting = rng.uniform(seconds[0], max(seconds[-1], seconds[0] + 1e-6)), rng.uniform(0.4, 1.0)
        heading, climb = rng.uniform(0, 2 * np.pi), rng.uniform(-0.2, 0.2)
        # The steepest point of the step is 1.5 times its mean: 5.2 m/s² on average stay below g·tan 40°.
        change = rng.uniform(1.0, 5.2) * lasting * np.array([np.cos(heading), np.sin(heading), climb])
        velocity += change * _smooth_step((seconds - begin) / lasting)[:, None]
    step = seconds[1] - seconds[0] if len(seconds) > 1 else 0.0
    return np.cumsum(velocity, axis=0) * step


def _hover(seconds: np.ndarray, rng: np.random.Generator, max_travel: float) -> Flight:
    """Hover, dash and reversal of a multicopter: tilt follows acceleration, yaw is free."""
    reach = 10 ** rng.uniform(-1.7, 0.3)  # 2 cm of hover jitter to 2 m of swaying
    axes = [(wobble(seconds, rng, amplitude=reach * a)) for a in (1.0, 1.0, 0.4)]
    drift = rng.normal(0, 1.0, 3) * np.array([1.5, 1.5, 0.4]) * rng.uniform(0, 1)
    path = np.stack(axes, axis=1) + seconds[:, None] * drift
    if rng.uniform() < 0.5:
        path = 0.2 * path + _dashes(seconds, rng)
    position = path * fitting(path, max_travel)
    acceleration = np.zeros_like(position)
    if len(seconds) > 2:
        step = seconds[1] - seconds[0]
        acceleration = np.gradient(np.gradient(position, step, axis=0), step, axis=0)
    horizontal = acceleration[:, :2]
    size = np.linalg.norm(horizontal, axis=1, keepdims=True)
    horizontal = horizontal * np.minimum(1.0, GRAVITY * np.tan(np.deg2rad(40.0)) / np.maximum(size, 1e-9))
    yaw = rng.uniform(0, 2 * np.pi) + rng.uniform(-2.0, 2.0) * seconds
    forward = np.cos(yaw) * horizontal[:, 0] + np.sin(yaw) * horizontal[:, 1]
    left = -np.sin(yaw) * horizontal[:, 0] + np.cos(yaw) * horizontal[:, 1]
    steady = np.deg2rad(rng.normal(0, 4.0, 2))  # leaning into a wind
    pitch = np.arctan2(forward, GRAVITY) + steady[0]
    roll = -np.arctan2(left, GRAVITY) + steady[1]
    return Flight(position - position[len(position) // 2], _attitude(yaw, pitch, roll))
