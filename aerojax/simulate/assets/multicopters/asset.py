"""Multicopters with three to eight arms: frame, motors, guards and propellers, put together with the body's parts."""

from __future__ import annotations

import numpy as np

from aerojax.simulate.assets.mesh.lofts import RotorShape, rotor
from aerojax.simulate.assets.mesh.parts import Part, Spin
from aerojax.simulate.assets.mesh.shapes import (
    Mesh,
    Vector,
    both_sides,
    box,
    hoop,
    merge,
    moved,
    polyline_tube,
    ring,
    rotation_about,
    tube,
)
from aerojax.simulate.assets.multicopters.bodies import fittings, hull
from aerojax.simulate.assets.multicopters.layout import (
    MulticopterParameters,
    along,
    motor_axis,
    motor_positions,
    motor_sides,
    propeller_radius,
)
from aerojax.simulate.usd.authoring import Asset, normalised


def build_multicopter(p: MulticopterParameters, rng: np.random.Generator) -> Asset:
    """Build the parts; `rng` draws only phases of the propellers and the length of the cycle."""
    motors = [(float(x), float(y), float(z)) for x, y, z in motor_positions(p)]
    parts = [Part("hull", hull(p), 0), Part("arms", _arms(p, motors), 1), Part("motors", _motors(p, motors), 2)]
    parts += [Part(name, mesh, role) for name, mesh, role in fittings(p, motors)]
    if p.guard != "none":
        parts.append(Part("guards", _GUARDS[p.guard](p, motors), 3))
    asset = Asset((*parts, *_propellers(p, motors, rng)), cycle_seconds=float(rng.uniform(0.4, 0.7)))
    hubs = np.array([part.spin.hub[:2] for part in asset.parts if part.spin is not None])
    return normalised(asset, float(np.linalg.norm(hubs[:, None] - hubs[None], axis=-1).max()))


def _arms(p: MulticopterParameters, motors: list[Vector]) -> Mesh:
    beams = _FRAMES[p.frame](p, motors) if p.frame in _FRAMES else _from_hull(p, motors)
    extra = [hoop((0.0, 0.0, p.arm_rise), (0.0, 0.0, 1.0), 0.5, 0.8 * p.arm_width, 36)] if p.frame == "rim" else []
    return merge(*(_beam(p, start, end) for start, end in beams), *extra)


Beams = list[tuple[Vector, Vector]]


def _root(p: MulticopterParameters, motor: Vector) -> Vector:
    """Where a radial arm starts: towards its motor, but inside the hull however narrow that is."""
    x, y, z = motor
    share = min(0.25, 0.25 * p.hull_length / max(abs(x), 1e-6), 0.25 * p.hull_width / max(abs(y), 1e-6))
    return (share * x, share * y, max(min(0.0, z), -0.3 * p.hull_height))


def _from_hull(p: MulticopterParameters, motors: list[Vector]) -> Beams:
    """One arm a motor, from the middle ("radial", "rim"), the spine's ends ("v") or the hull's corners ("corners")."""
    beams: Beams = []
    for x, y, z in motors:
        root = _root(p, (x, y, z))
        if p.frame == "v":
            root = (float(np.sign(x)) * 0.25 * p.hull_length, 0.0, root[2])
        elif p.frame == "corners":
            root = (float(np.sign(x)) * 0.34 * p.hull_length, float(np.sign(y)) * 0.32 * p.hull_width, 0.4 * z)
        beams.append((root, (x, y, z)))
    return beams


def _crossbars(p: MulticopterParameters, motors: list[Vector]) -> Beams:
    beams: Beams = [((x, -y, z), (x, y, z)) for x, y, z in motors[:2]]
    return [*beams, ((motors[0][0], 0.0, motors[0][2]), (motors[1][0], 0.0, motors[1][2]))]


def _rails(p: MulticopterParameters, motors: list[Vector]) -> Beams:
    """Two rails with a row of motors each, and two crossbars through the hull."""
    half = len(motors) // 2
    x, y, z = motors[0]
    across: Beams = [((a * x, -y, z), (a * x, y, z)) for a in (0.33, -0.33)]
    return [(motors[0], motors[half - 1]), (motors[-1], motors[half]), *across]


def _side_arms(p: MulticopterParameters, motors: list[Vector]) -> Beams:
    """A raised arm to either side that ends in a bar with a motor in front and one behind."""
    beams: Beams = []
    for front, rear in ((motors[0], motors[1]), (motors[3], motors[2])):
        middle = tuple(0.5 * (a + b) for a, b in zip(front, rear, strict=True))
        beams += [((0.0, 0.3 * middle[1], 0.0), (middle[0], middle[1], middle[2])), (front, rear)]
    return beams


def _knees(p: MulticopterParameters, motors: list[Vector]) -> Beams:
    """Arms that climb to a knee and fall to the motor, as a spider's legs."""
    beams: Beams = []
    for x, y, z in motors:
        knee = (0.5 * x, 0.5 * y, z + 0.075)
        beams += [(_root(p, (x, y, z)), knee), (knee, (x, y, z))]
    return beams


def _tail_boom(p: MulticopterParameters, motors: list[Vector]) -> Beams:
    """Wide front arms; the rear pair branches in a V from the end of a boom."""
    end = (0.93 * motors[1][0], 0.0, p.arm_rise)
    front: Beams = [(_root(p, motor), motor) for motor in (motors[0], motors[3])]
    return [*front, ((0.0, 0.0, 0.0), end), (end, motors[1]), (end, motors[2])]


_FRAMES = {
    "h": _crossbars,
    "rails": _rails,
    "t": _side_arms,
    "spider": _knees,
    "vtail": _tail_boom,
}


def _beam(p: MulticopterParameters, start: Vector, end: Vector) -> Mesh:
    if p.round_arms:
        return tube(start, end, p.arm_width / 2, sides=8)
    delta = np.asarray(end) - np.asarray(start)
    length, heading = float(np.linalg.norm(delta)), float(np.degrees(np.arctan2(delta[1], delta[0])))
    climb = float(np.degrees(np.arcsin(delta[2] / length)))
    bar = box((length / 2, 0.0, 0.0), (length, p.arm_width, p.arm_height))
    turn = rotation_about((0.0, 0.0, 1.0), heading) @ rotation_about((0.0, 1.0, 0.0), -climb)
    return moved(bar, start, turn)


def _motors(p: MulticopterParameters, motors: list[Vector]) -> Mesh:
    low, cans = -0.7 * p.arm_height, []
    for motor in motors:
        axis = motor_axis(p, motor)
        for side in motor_sides(p):
            top = along(motor, axis, side * p.motor_height)
            cans.append(tube(along(motor, axis, side * low), top, p.motor_radius, sides=12))
            cans.append(tube(motor, along(top, axis, side * 0.025), 0.25 * p.motor_radius, sides=6))
    return merge(*cans)


def _hub_height(p: MulticopterParameters) -> float:
    """Signed distance from the arm to the propeller (to the upper one of a pair)."""
    return motor_sides(p)[0] * (p.motor_height + 0.015)


def _ring_guards(p: MulticopterParameters, motors: list[Vector]) -> Mesh:
    """A duct or a thin ring around each propeller, on three spokes."""
    radius = propeller_radius(p)
    height, wall = (p.guard_height, 0.022) if p.guard == "duct" else (0.025, 0.018)
    # The spokes must stay clear of the blades.
    plane = _hub_height(p) - motor_sides(p)[0] * max(0.3 * height, 0.035)
    rings = [ring((x, y, z + plane), 1.05 * radius + wall / 2, height, wall) for x, y, z in motors]
    spokes = []
    for x, y, z in motors:
        for degrees in (30.0, 150.0, 270.0):
            angle = np.deg2rad(degrees) + np.arctan2(y, x)
            reach = 1.05 * radius
            edge = (x + reach * float(np.cos(angle)), y + reach * float(np.sin(angle)), z + plane)
            spokes.append(tube((x, y, z), edge, 0.009, sides=6))
    return merge(*rings, *spokes)


def _cage(p: MulticopterParameters, motors: list[Vector]) -> Mesh:
    """A sphere of hoops around everything, tied to the arms' ends."""
    radius, width = 0.5 + 1.12 * propeller_radius(p), 0.02
    hoops = [hoop((0.0, 0.0, 0.0), (float(np.cos(a)), float(np.sin(a)), 0.0), radius, width, 28)
             for a in np.deg2rad([0.0, 60.0, 120.0])]  # fmt: skip
    for latitude in np.deg2rad([-38.0, 0.0, 38.0]):
        level = (0.0, 0.0, radius * float(np.sin(latitude)))
        hoops.append(hoop(level, (0.0, 0.0, 1.0), radius * float(np.cos(latitude)), width, 28))
    ties = []
    for x, y, z in motors:
        outward = radius / float(np.hypot(x, y))
        ties.append(tube((x, y, z), (outward * x, outward * y, 0.0), 0.009, sides=6))
    return merge(*hoops, *ties)


def _grille(p: MulticopterParameters, motors: list[Vector]) -> Mesh:
    """A flat box of rims and bars in which all propellers turn."""
    radius = propeller_radius(p)
    x, y = (max(abs(m[axis]) for m in motors) + 1.05 * radius for axis in (0, 1))
    high, low = p.arm_rise + _hub_height(p) + 0.03, p.arm_rise - 0.5 * p.arm_height
    parts = [tube((a, b, low), (a, b, high), 0.012, sides=6) for a in (-x, 0.0, x) for b in (-y, y)]
    for z in (low, high):
        parts.append(polyline_tube([(x, y, z), (-x, y, z), (-x, -y, z), (x, -y, z), (x, y, z)], 0.015, sides=6))
        parts += [tube((float(a), -y, z), (float(a), y, z), 0.007, sides=4) for a in np.linspace(-x, x, 11)[1:-1]]
    return merge(*parts, both_sides(tube((0.0, 0.0, low), (0.0, y, low), 0.015, sides=6)))


_GUARDS = {"duct": _ring_guards, "ring": _ring_guards, "cage": _cage, "grille": _grille}


def _propellers(p: MulticopterParameters, motors: list[Vector], rng: np.random.Generator) -> list[Part]:
    radius, parts = propeller_radius(p), []
    for i, motor in enumerate(motors):
        axis = motor_axis(p, motor)
        for j, side in enumerate(motor_sides(p)):
            # Neighbours turn against each other, and so do the two of a coaxial pair.
            clockwise = (i + j) % 2 == 1
            chord = p.blade_chord * radius
            shape = RotorShape(p.blades, radius, 1.15 * chord, 0.65 * chord, (20.0, 9.0), 0.02, 0.02, 0.0, clockwise)
            hertz = p.hertz * float(rng.uniform(0.97, 1.03)) * (-1.0 if clockwise else 1.0)
            hub = along(motor, axis, side * (p.motor_height + 0.015))
            spin = Spin(hub, axis, hertz, float(rng.uniform(0, 360)))
            parts.append(Part(f"propeller_{len(parts)}", rotor(shape), 3, spin))
    return parts
