"""Multicopters with three to eight arms; lengths are fractions of the largest motor-to-motor distance.

Proportions follow real machines: a propeller's radius is 0.7-0.97 of half the distance between neighbouring motors
(0.34 of the diagonal on a 350 mm camera quadcopter, 0.29 on a 5-inch racer, 0.18 on an octocopter).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from aerojax.simulate.assets.authoring import Asset, Part, Spin, normalised
from aerojax.simulate.assets.lofts import RotorShape, body, rotor
from aerojax.simulate.assets.multicopter_families import FAMILIES
from aerojax.simulate.assets.shapes import (
    Mesh,
    Vector,
    both_sides,
    box,
    ellipsoid,
    merge,
    moved,
    polyline_tube,
    ring,
    rotation_about,
    tube,
)
from aerojax.simulate.assets.variation import draw


@dataclass(frozen=True)
class MulticopterParameters:
    """Shape of a multicopter; lengths over the motor-to-motor diagonal, angles in degrees."""

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
    frame: str
    hull: str
    hull_length: float
    hull_width: float
    hull_height: float
    legs: str
    leg_height: float
    motor_radius: float
    motor_height: float
    hertz: float
    coaxial: bool = False
    pusher: bool = False
    guard: str = "none"
    gimbal: float = 0.0
    payload: str = "none"
    payload_size: float = 0.0
    battery: float = 0.0
    antennas: int = 0
    gps_mast: float = 0.0


def draw_parameters(family: str, rng: np.random.Generator) -> MulticopterParameters:
    """Draw one multicopter of a family."""
    return draw(MulticopterParameters, FAMILIES[family], rng)


def motor_positions(p: MulticopterParameters) -> Float[np.ndarray, "arm 3"]:
    """Arm ends (motor bases), counter-clockwise from the front left; the largest distance between two is 1."""
    if p.arms == 3:
        degrees = np.array([p.nose_angle, 180.0, -p.nose_angle])
    elif p.arms == 4:
        degrees = np.array([p.nose_angle, 180.0 - p.tail_angle, 180.0 + p.tail_angle, -p.nose_angle])
    else:
        degrees = p.nose_angle + 360.0 * np.arange(p.arms) / p.arms
    angle = np.deg2rad(degrees)
    flat = np.stack([np.cos(angle), np.sin(angle), np.zeros(p.arms)], axis=1)
    flat /= np.linalg.norm(flat[:, None] - flat[None], axis=-1).max()
    return flat + np.array([0.0, 0.0, p.arm_rise])


def propeller_radius(p: MulticopterParameters) -> float:
    """Half the distance between the closest motors, times the fill."""
    motors = motor_positions(p)
    distance = np.linalg.norm(motors[:, None] - motors[None], axis=-1) + 9.0 * np.eye(p.arms)
    return float(distance.min()) / 2 * p.propeller_fill


def author(p: MulticopterParameters, rng: np.random.Generator) -> Asset:
    """Build the parts; `rng` draws only phases of the propellers."""
    motors = [(float(x), float(y), float(z)) for x, y, z in motor_positions(p)]
    parts = [Part("hull", _hull(p), 0), Part("arms", _arms(p, motors), 1), Part("motors", _motors(p, motors), 2)]
    parts += [Part(name, mesh, role) for name, mesh, role in _fittings(p, motors) if mesh is not None]
    if p.guard != "none":
        parts.append(Part("guards", _guards(p, motors), 3))
    asset = Asset((*parts, *_propellers(p, motors, rng)), cycle_seconds=float(rng.uniform(0.4, 0.7)))
    return normalised(asset, 1.0)


def _hull(p: MulticopterParameters) -> Mesh:
    length, width, height = p.hull_length / 2, p.hull_width / 2, p.hull_height / 2
    if p.hull == "dome":
        keys = [
            (-length, 0.25 * width, 0.3 * height, 0.1 * height),
            (-0.6 * length, 0.85 * width, 0.8 * height, 0.15 * height),
            (0.15 * length, width, height, 0.0),
            (0.75 * length, 0.75 * width, 0.7 * height, -0.1 * height),
            (length, 0.3 * width, 0.25 * height, -0.1 * height),
        ]
        return body(keys, exponent=2.6, stations=14, sides=16)
    if p.hull == "box":
        size = (2 * length, 2 * width, 2 * height)
        lid = box((-0.1 * length, 0.0, height), (1.2 * length, 1.3 * width, 0.5 * height))
        return merge(box((0.0, 0.0, 0.0), size), lid)
    thickness = 0.018
    plate = _plate(length, width, thickness)
    if p.hull == "plate":
        return merge(plate, box((0.0, 0.0, 0.04), (length, width, 0.06)))
    levels = [moved(plate, (0.0, 0.0, z)) for z in (-height, height)]
    posts = [tube((x * length, y * width, -height), (x * length, y * width, height), 0.012, sides=6)
             for x in (-0.8, 0.8) for y in (-0.7, 0.7)]  # fmt: skip
    return merge(*levels, *posts, box((0.0, 0.0, -0.2 * height), (1.1 * length, 1.1 * width, 1.1 * height)))


def _plate(length: float, width: float, thickness: float) -> Mesh:
    """A flat deck with bevelled corners."""
    keys = [(-length, 0.55 * width), (-0.7 * length, width), (0.7 * length, width), (length, 0.55 * width)]
    return body([(x, w, thickness / 2, 0.0) for x, w in keys], exponent=8.0, power=1.0, stations=6, sides=8)


def _arms(p: MulticopterParameters, motors: list[Vector]) -> Mesh:
    if p.frame == "h":
        rails = [[(x, -y, z), (x, y, z)] for x, y, z in motors[:2]]
        ends = [(motors[0][0], 0.0, p.arm_rise), (motors[1][0], 0.0, p.arm_rise)]
        return merge(*(_beam(p, a, b) for a, b in [*rails, ends]))
    roots = []
    for x, y, _ in motors:
        inward = 0.25 if p.frame == "radial" else 0.0
        along = np.sign(x) * 0.32 * p.hull_length if p.frame == "v" else inward * x
        roots.append((float(along), inward * y, 0.0))
    return merge(*(_beam(p, a, b) for a, b in zip(roots, motors, strict=True)))


def _beam(p: MulticopterParameters, start: Vector, end: Vector) -> Mesh:
    if p.round_arms:
        return tube(start, end, p.arm_width / 2, sides=8)
    delta = np.asarray(end) - np.asarray(start)
    length, heading = float(np.linalg.norm(delta)), float(np.degrees(np.arctan2(delta[1], delta[0])))
    climb = float(np.degrees(np.arcsin(delta[2] / length)))
    bar = box((length / 2, 0.0, 0.0), (length, p.arm_width, p.arm_height))
    turn = rotation_about((0.0, 0.0, 1.0), heading) @ rotation_about((0.0, 1.0, 0.0), -climb)
    return moved(bar, start, turn)


def _sides(p: MulticopterParameters) -> tuple[float, ...]:
    """Which way motors point from the arm: up, down, or both."""
    return (1.0, -1.0) if p.coaxial else (-1.0,) if p.pusher else (1.0,)


def _motors(p: MulticopterParameters, motors: list[Vector]) -> Mesh:
    low, cans = -0.7 * p.arm_height, []
    for x, y, z in motors:
        for side in _sides(p):
            cans.append(tube((x, y, z + side * low), (x, y, z + side * p.motor_height), p.motor_radius, sides=12))
            top = z + side * (p.motor_height + 0.025)
            cans.append(tube((x, y, z), (x, y, top), 0.25 * p.motor_radius, sides=6))
    return merge(*cans)


def _guards(p: MulticopterParameters, motors: list[Vector]) -> Mesh:
    radius, plane = propeller_radius(p), p.motor_height + 0.015
    height, wall = (0.12, 0.022) if p.guard == "duct" else (0.025, 0.018)
    rings = [ring((x, y, z + plane - 0.3 * height), 1.05 * radius + wall / 2, height, wall) for x, y, z in motors]
    spokes = []
    for x, y, z in motors:
        for degrees in (30.0, 150.0, 270.0):
            angle = np.deg2rad(degrees) + np.arctan2(y, x)
            reach = 1.05 * radius
            edge = (x + reach * float(np.cos(angle)), y + reach * float(np.sin(angle)), z + plane - 0.3 * height)
            spokes.append(tube((x, y, z), edge, 0.009, sides=6))
    return merge(*rings, *spokes)


def _fittings(p: MulticopterParameters, motors: list[Vector]) -> list[tuple[str, Mesh | None, int]]:
    under = -p.hull_height / 2
    battery = box((-0.05 * p.hull_length, 0.0, -under + 0.03), (0.6 * p.hull_length, p.battery, 0.06))
    gimbal = None
    if p.gimbal > 0:
        front = 0.36 * p.hull_length
        ball = ellipsoid((front, 0.0, under - 0.65 * p.gimbal), (0.5 * p.gimbal, 0.45 * p.gimbal, 0.45 * p.gimbal))
        lens = tube(
            (front, 0.0, under - 0.65 * p.gimbal),
            (front + 0.65 * p.gimbal, 0.0, under - 0.68 * p.gimbal),
            0.25 * p.gimbal,
        )
        gimbal = merge(
            ball, lens, box((front, 0.0, under - 0.15 * p.gimbal), (0.5 * p.gimbal, 0.8 * p.gimbal, 0.5 * p.gimbal))
        )
    masts = [polyline_tube([(-0.4 * p.hull_length, y, 0.0), (-0.55 * p.hull_length, 1.6 * y, 0.2)], 0.008, sides=6)
             for y in np.linspace(-0.06, 0.06, p.antennas)] if p.antennas else []  # fmt: skip
    if p.gps_mast > 0:
        x, top = -0.2 * p.hull_length, -under + p.gps_mast
        masts += [
            tube((x, 0.05, 0.0), (x, 0.05, top), 0.008, sides=6),
            tube((x, 0.05, top), (x, 0.05, top + 0.02), 0.045),
        ]
    return [
        ("battery", battery if p.battery > 0 else None, 4),
        ("gimbal", gimbal, 5),
        ("masts", merge(*masts) if masts else None, 4),
        ("legs", _legs(p, motors), 6),
        ("payload", _payload(p), 7),
    ]


def _legs(p: MulticopterParameters, motors: list[Vector]) -> Mesh | None:
    under, radius = -p.hull_height / 2, 0.014
    foot = under - p.leg_height
    if p.legs == "none":
        return None
    if p.legs == "motor_posts":
        return merge(*(tube((x, y, z), (x, y, z - p.leg_height), 0.016, 0.01, sides=6) for x, y, z in motors))
    x, y = 0.3 * p.hull_length, 0.38 * p.hull_width
    spread = y + 0.35 * p.leg_height
    struts = [tube((a, y, under + 0.02), (1.3 * a, spread, foot), radius, sides=6) for a in (-x, x)]
    if p.legs == "skids":
        reach = x * 1.3 + 0.08
        struts.append(tube((-reach, spread, foot), (reach, spread, foot), radius * 1.1, sides=6))
    return both_sides(merge(*struts))


def _payload(p: MulticopterParameters) -> Mesh | None:
    size, under = p.payload_size, -p.hull_height / 2
    if p.payload == "box":
        return box((0.0, 0.0, under - 0.35 * size), (1.2 * size, size, 0.7 * size))
    if p.payload == "tank":
        return ellipsoid((0.0, 0.0, under - 0.4 * size), (0.75 * size, 0.65 * size, 0.45 * size))
    if p.payload == "bottle":
        return tube(
            (0.0, -0.7 * size, under - 0.3 * size), (0.0, 0.7 * size, under - 0.3 * size), 0.28 * size, sides=14
        )
    return None


def _propellers(p: MulticopterParameters, motors: list[Vector], rng: np.random.Generator) -> list[Part]:
    radius, parts = propeller_radius(p), []
    for i, (x, y, z) in enumerate(motors):
        for j, side in enumerate(_sides(p)):
            # Neighbours turn against each other, and so do the two of a coaxial pair.
            clockwise = (i + j) % 2 == 1
            chord = p.blade_chord * radius
            shape = RotorShape(p.blades, radius, 1.15 * chord, 0.65 * chord, (20.0, 9.0), 0.02, 0.02, 0.0, clockwise)
            hertz = p.hertz * float(rng.uniform(0.97, 1.03)) * (-1.0 if clockwise else 1.0)
            hub = (x, y, z + side * (p.motor_height + 0.015))
            spin = Spin(hub, (0.0, 0.0, 1.0), hertz, float(rng.uniform(0, 360)))
            parts.append(Part(f"propeller_{len(parts)}", rotor(shape), 3, spin))
    return parts
