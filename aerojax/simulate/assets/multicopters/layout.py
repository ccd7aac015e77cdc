"""Parameters of a multicopter and where its motors and propellers are.

Lengths are fractions of the largest motor-to-motor distance. Proportions follow real machines: a propeller's radius is
0.6-0.97 of half the distance between neighbouring motors (0.34 of the diagonal on a 350 mm camera quadcopter, 0.29 on
a 5-inch racer, 0.18 on an octocopter).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from aerojax.simulate.assets.mesh.shapes import Vector


@dataclass(frozen=True)
class MulticopterParameters:
    """Shape of a multicopter; lengths over the motor-to-motor diagonal, angles in degrees.

    layout: where motors are: "ring" (3, 4 or evenly spaced arms), "plus" (an arm to the nose) or "rails" (two rows).
    frame: what carries them: "radial", "v" and "corners" (arms from one point, two points or the hull's corners), "h"
        (crossbars on a spine), "rails", "t" (raised side arms with a bar each), "rim" (spokes and a hoop), "spider"
        (arms with a knee) or "vtail" (rear pair on a tail boom).
    rear_rise: extra height of the rear motors; rear_tilt: lean of their axes towards the middle plane.
    roof: "none", "lidar" (drum on a mast), "parachute" (canister) or "camera" (tilted on the front edge).
    boom_span: length of a spray boom below the hull; tether: length of a load's line; tail: "none", "vee" or "fin".
    """

    arms: int
    nose_angle: float
    tail_angle: float
    propeller_fill: float
    blades: int
    blade_chord: float
    arm_width: float
    arm_height: float
    arm_rise: float
    round_arms: bool
    frame: Literal["radial", "v", "corners", "h", "rails", "t", "rim", "spider", "vtail"]
    hull: Literal["box", "dome", "egg", "fuselage", "plate", "slab", "stack"]
    hull_length: float
    hull_width: float
    hull_height: float
    legs: Literal["none", "skids", "posts", "motor_posts", "retracted"]
    leg_height: float
    motor_radius: float
    motor_height: float
    hertz: float
    coaxial: bool = False
    pusher: bool = False
    guard: Literal["none", "ring", "duct", "cage", "grille"] = "none"
    gimbal: float = 0.0
    payload: Literal["none", "box", "tank", "bottle", "sling"] = "none"
    payload_size: float = 0.0
    battery: float = 0.0
    antennas: int = 0
    gps_mast: float = 0.0
    layout: Literal["ring", "plus", "rails"] = "ring"
    rear_rise: float = 0.0
    rear_tilt: float = 0.0
    guard_height: float = 0.12
    roof: Literal["none", "lidar", "parachute", "camera"] = "none"
    roof_size: float = 0.0
    boom_span: float = 0.0
    tether: float = 0.0
    tail: Literal["none", "vee", "fin"] = "none"
    tail_size: float = 0.0


def _flat_positions(p: MulticopterParameters) -> Float[np.ndarray, "arm 2"]:
    """Directions of the arm ends before scaling, counter-clockwise from the front left."""
    if p.layout == "rails":
        nose = np.deg2rad(p.nose_angle)
        x = np.linspace(np.cos(nose), -np.cos(nose), p.arms // 2)
        y = np.full_like(x, np.sin(nose))
        return np.concatenate([np.stack([x, y], 1), np.stack([x, -y], 1)[::-1]])
    if p.layout == "plus":
        degrees = np.array([0.0, 90.0, 180.0, 270.0])
    elif p.arms == 3:
        degrees = np.array([p.nose_angle, 180.0, -p.nose_angle])
    elif p.arms == 4:
        degrees = np.array([p.nose_angle, 180.0 - p.tail_angle, 180.0 + p.tail_angle, -p.nose_angle])
    else:
        degrees = p.nose_angle + 360.0 * np.arange(p.arms) / p.arms
    angle = np.deg2rad(degrees)
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def motor_positions(p: MulticopterParameters) -> Float[np.ndarray, "arm 3"]:
    """Arm ends (motor bases), counter-clockwise from the front left; the largest horizontal distance is 1."""
    flat = _flat_positions(p)
    flat = flat / np.linalg.norm(flat[:, None] - flat[None], axis=-1).max()
    height = p.arm_rise + p.rear_rise * (flat[:, 0] < -0.1)
    return np.concatenate([flat, height[:, None]], axis=1)


def motor_axis(p: MulticopterParameters, motor: Vector) -> Vector:
    """Unit direction from the arm to an upper propeller: up, but for tilted rear motors."""
    if p.rear_tilt == 0 or motor[0] > -0.1:
        return (0.0, 0.0, 1.0)
    tilt = np.deg2rad(p.rear_tilt)
    return (0.0, float(-np.sign(motor[1]) * np.sin(tilt)), float(np.cos(tilt)))


def along(start: Vector, axis: Vector, distance: float) -> Vector:
    """The point at a distance from `start` along a unit axis."""
    x, y, z = (a + distance * b for a, b in zip(start, axis, strict=True))
    return (x, y, z)


def hull_under(p: MulticopterParameters) -> float:
    """Height of the hull's underside; a plate has no depth."""
    return -0.009 if p.hull == "plate" else -p.hull_height / 2


def hull_top(p: MulticopterParameters) -> float:
    """Height of the hull's upper side, without battery and lid."""
    return 0.07 if p.hull == "plate" else p.hull_height / 2


def _beside_hull(p: MulticopterParameters, motor: Float[np.ndarray, "3"]) -> float:
    """Horizontal distance of a motor from the hull where a propeller's plane cuts it, else infinity."""
    lid = 0.06 if p.battery > 0 else 0.13 * p.hull_height if p.hull == "box" else 0.0
    planes = [motor[2] + side * (p.motor_height + 0.015) for side in motor_sides(p)]
    if not any(hull_under(p) - 0.02 < plane < hull_top(p) + lid + 0.02 for plane in planes):
        return float("inf")
    # Rounded shells leave the corners of their bounding box empty.
    share = 0.5 if p.hull in ("box", "stack", "plate", "slab") else 0.4
    gap = np.abs(motor[:2]) - share * np.array([p.hull_length, p.hull_width])
    return float(np.linalg.norm(gap.clip(0.0)))


def propeller_radius(p: MulticopterParameters) -> float:
    """Half the distance between the closest propellers, times the fill; less where the hull would be struck."""
    motors = motor_positions(p)
    reach = motor_sides(p)[0] * (p.motor_height + 0.015)
    hubs = motors + reach * np.array([motor_axis(p, (float(x), float(y), float(z))) for x, y, z in motors])
    distance = np.linalg.norm(hubs[:, None] - hubs[None], axis=-1) + 9.0 * np.eye(p.arms)
    beside = min(_beside_hull(p, motor) for motor in motors)
    return min(float(distance.min()) / 2 * p.propeller_fill, 0.97 * beside)


def motor_sides(p: MulticopterParameters) -> tuple[float, ...]:
    """Which way motors point from the arm: up, down, or both."""
    return (1.0, -1.0) if p.coaxial else (-1.0,) if p.pusher else (1.0,)


def clear_radius(p: MulticopterParameters) -> float:
    """Distance from the vertical axis within which no propeller passes; never below 0.03."""
    nearest = float(np.linalg.norm(motor_positions(p)[:, :2], axis=1).min())
    return max(nearest - propeller_radius(p), 0.03)
