"""Helicopters with one, two tandem or two coaxial rotors; lengths are fractions of the fuselage length, nose to tail.

Proportions follow real machines: rotor diameter over fuselage length 1.11 (R44), 1.15 (Bo 105), 1.06 (UH-60), 0.97
(AH-64), 1.0 (EC135); cabin width 0.13-0.2; blade chord 0.05-0.08 of the radius.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerojax.simulate.assets.authoring import Asset, Part, Spin, normalised
from aerojax.simulate.assets.helicopter_families import FAMILIES
from aerojax.simulate.assets.lofts import Key, RotorShape, body, rotor, trapezoid
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
class HelicopterParameters:
    """Shape of a helicopter; lengths over the fuselage length, angles in degrees."""

    layout: str
    cabin_length: float
    cabin_width: float
    cabin_height: float
    cabin_exponent: float
    nose_height: float
    nose_fullness: float
    belly_rise: float
    boom_root: float
    boom_tip: float
    boom_height: float
    boom: str
    cowling_length: float
    cowling_height: float
    fin_height: float
    fin_chord: float
    fin_sweep: float
    fin_below: float
    stabiliser_span: float
    stabiliser_chord: float
    stabiliser_place: float
    end_plates: float
    tail_rotor: str
    tail_radius: float
    tail_blades: int
    blades: int
    rotor_ratio: float
    blade_chord: float
    mast_place: float
    mast_height: float
    coning: float
    gear: str
    gear_height: float
    gear_width: float
    hertz: float
    tail_gearing: float
    stub_wings: float = 0.0
    sponsons: float = 0.0


def draw_parameters(family: str, rng: np.random.Generator) -> HelicopterParameters:
    """Draw one helicopter of a family."""
    return draw(HelicopterParameters, FAMILIES[family], rng)


def author(p: HelicopterParameters, rng: np.random.Generator) -> Asset:
    """Build the parts; `rng` draws only phases of the rotors and the length of the cycle."""
    cabin = _cabin_keys(p)
    parts = [
        Part("cabin", body(cabin, p.cabin_exponent, stations=20), 0),
        Part("glass", _glass(p, cabin), 1),
        Part("cowling", _cowling(p), 2),
        Part("mast", merge(*(_mast(p, hub) for hub, _ in _hubs(p))), 4),
        Part("gear", _gear(p), 5),
    ]
    if p.layout == "tandem":
        parts.append(Part("pylons", _pylons(p), 0))
    else:
        parts += [Part("boom", _boom(p), 0), Part("tail", _tail(p), 3)]
    if p.stub_wings > 0:
        parts.append(Part("stub_wings", _stub_wings(p), 6))
    if p.sponsons > 0:
        parts.append(Part("sponsons", both_sides(_sponson(p)), 6))
    length = float(np.ptp(np.concatenate([part.mesh.points[:, 0] for part in parts])))
    asset = Asset((*parts, *_rotors(p, rng)), cycle_seconds=float(rng.uniform(0.9, 1.1)))
    return normalised(asset, length)


def _cabin_keys(p: HelicopterParameters) -> list[Key]:
    """Cabin from the nose at x = 0 aft; its rear closes at the height of the boom."""
    w, h, length = p.cabin_width / 2, p.cabin_height / 2, p.cabin_length
    low = p.nose_height * h
    rear = p.belly_rise * h + 0.35 * p.boom_height
    return [
        (0.0, 0.06 * w, 0.05 * h, low),
        (-0.12 * length, p.nose_fullness * w, p.nose_fullness * h, 0.55 * low),
        (-0.38 * length, w, h, 0.0),
        (-0.66 * length, 0.96 * w, 0.94 * h, 0.06 * h),
        (-0.88 * length, 0.6 * w, 0.55 * h, 0.6 * rear),
        (-length, 0.12 * w, 0.14 * h, rear),
    ]


def _glass(p: HelicopterParameters, cabin: list[Key]) -> Mesh:
    """Windscreen: the cabin's front, a little larger and higher, ahead of the doors."""
    nose, front, middle, *_ = cabin
    start = nose[0] + 0.3 * (front[0] - nose[0])
    end = middle[0] - 0.05
    keys = [
        (start, 0.3 * front[1], 0.25 * front[2], 0.7 * nose[3] + 0.15 * front[2]),
        (front[0], 0.93 * front[1], 0.75 * front[2], front[3] + 0.3 * front[2]),
        (0.5 * (front[0] + middle[0]), 1.02 * 0.5 * (front[1] + middle[1]), 0.6 * middle[2], 0.4 * middle[2]),
        (end, 1.01 * middle[1], 0.4 * middle[2], 0.42 * middle[2]),
    ]
    return body(keys, p.cabin_exponent, stations=10, sides=14)


def _cowling(p: HelicopterParameters) -> Mesh:
    """Engine and gearbox housing on the roof, around the mast."""
    roof, x, half = 0.42 * p.cabin_height, -p.mast_place, p.cowling_length / 2
    if p.layout == "tandem":
        x, half = -0.86, 0.1
    keys = [
        (x + 1.1 * half, 0.1 * p.cabin_width, 0.12 * p.cowling_height, roof),
        (x + 0.4 * half, 0.36 * p.cabin_width, p.cowling_height, roof),
        (x - 0.5 * half, 0.38 * p.cabin_width, 0.95 * p.cowling_height, roof),
        (x - 1.5 * half, 0.16 * p.cabin_width, 0.3 * p.cowling_height, roof - 0.3 * p.cowling_height),
    ]
    return body(keys, 2.8, stations=12, sides=14)


def _boom_height(p: HelicopterParameters, x: float) -> float:
    """Height of the boom's axis; it rises from the cabin's rear to the tail."""
    rise = 0.4 * p.boom_height
    start = 0.5 * p.belly_rise * p.cabin_height * 0.6 + 0.35 * p.boom_height
    return start + rise * (x + p.cabin_length) / (p.cabin_length - 1.0)


def _between(start: Vector, end: Vector, share: float) -> Vector:
    x, y, z = ((1 - share) * a + share * b for a, b in zip(start, end, strict=True))
    return (x, y, z)


def _boom(p: HelicopterParameters) -> Mesh:
    start, end = -0.72 * p.cabin_length, -0.985
    low, high = _boom_height(p, start), _boom_height(p, end)
    if p.boom == "truss":
        size = p.boom_root
        rails = [[(start, 0.0, low + size), (end, 0.0, high)]]
        rails += [[(start, s * size, low - 0.7 * size), (end, 0.0, high)] for s in (-1.0, 1.0)]
        bars = [polyline_tube(rail, 0.008, sides=6) for rail in rails]
        for share in np.linspace(0.1, 0.8, 6):
            a, b, c = (_between(rail[0], rail[1], float(share)) for rail in rails)
            bars.append(polyline_tube([a, b, c, a], 0.005, sides=4))
        return merge(*bars)
    if p.boom == "rod":
        return tube((start, 0.0, low), (end, 0.0, high), p.boom_root, p.boom_tip)
    keys = [
        (start, 1.3 * p.boom_root, 1.6 * p.boom_root, low),
        (-p.cabin_length, p.boom_root, 1.15 * p.boom_root, _boom_height(p, -p.cabin_length)),
        (end, p.boom_tip, 1.2 * p.boom_tip, high),
    ]
    return body(keys, 2.0, power=1.0, stations=10, sides=12)


def _tail(p: HelicopterParameters) -> Mesh:
    high, chord = _boom_height(p, -0.97), p.fin_chord
    front = -0.99 + chord
    parts = []
    if p.layout != "coaxial":
        tip = (front - p.fin_sweep * p.fin_height, 0.0, high + p.fin_height)
        parts.append(trapezoid((front, 0.0, high), tip, chord, 0.6 * chord, 0.13, 0.0))
    if p.fin_below > 0 and p.layout != "coaxial":
        tip = (front - 0.5 * p.fin_below, 0.0, high - p.fin_below)
        parts.append(trapezoid((front, 0.0, high), tip, 0.9 * chord, 0.55 * chord, 0.13, 0.0))
    if p.stabiliser_span > 0:
        parts.append(both_sides(_stabiliser(p)))
    if p.tail_rotor == "fenestron":
        shroud = ring((0.0, 0.0, 0.0), p.tail_radius + 0.014, 0.045, 0.03, sides=20)
        parts.append(moved(shroud, _tail_hub(p), rotation_about((1.0, 0.0, 0.0), 90.0)))
    elif p.tail_rotor == "open":
        x, y, z = _tail_hub(p)
        parts.append(tube((x, 0.0, z), (x, y, z), 0.008, sides=6))
    return merge(*parts)


def _stabiliser(p: HelicopterParameters) -> Mesh:
    x = -p.stabiliser_place + p.stabiliser_chord / 2
    z, half = _boom_height(p, x), p.stabiliser_span / 2
    plane = trapezoid((x, 0.0, z), (x - 0.015, half, z), p.stabiliser_chord, 0.85 * p.stabiliser_chord, 0.12, 0.0)
    if p.end_plates == 0:
        return plane
    chord, height = 1.3 * p.stabiliser_chord, p.end_plates
    plate = trapezoid((x, half, z - 0.45 * height), (x - 0.03, half, z + 0.55 * height), chord, 0.7 * chord, 0.1, 0.0)
    return merge(plane, plate)


def _tail_hub(p: HelicopterParameters) -> Vector:
    x = -0.985 + 0.4 * p.fin_chord
    if p.tail_rotor == "fenestron":
        return (-0.985 + p.fin_chord - p.tail_radius - 0.01, 0.0, _boom_height(p, -0.97) - 0.01)
    lift = 0.75 * p.fin_height if p.fin_below == 0 else 0.1 * p.fin_height
    sweep = p.fin_sweep * lift if p.fin_below == 0 else 0.0
    return (x - 0.6 * sweep, 0.035, _boom_height(p, -0.97) + lift)


def _hubs(p: HelicopterParameters) -> list[tuple[Vector, bool]]:
    """Main rotor hubs and whether they turn clockwise."""
    base = 0.5 * p.cabin_height + 0.5 * p.cowling_height
    if p.layout == "tandem":
        top = 0.5 * p.cabin_height
        return [
            ((-p.mast_place, 0.0, top + 0.3 * p.mast_height + 0.03), False),
            ((-0.9, 0.0, p.fin_height + 0.07), True),
        ]
    first = (-p.mast_place, 0.0, base + p.mast_height)
    if p.layout == "coaxial":
        return [(first, False), ((first[0], 0.0, first[2] + 0.095), True)]
    return [(first, False)]


def _mast(p: HelicopterParameters, hub: Vector) -> Mesh:
    foot = (hub[0], 0.0, 0.3 * p.cabin_height if p.layout != "tandem" else hub[2] - 0.06)
    parts = [tube(foot, (hub[0], 0.0, hub[2] + 0.012), 0.012, sides=8)]
    if p.layout == "single" and p.mast_height > 0.09:
        fairing = [(hub[0] + 0.02, 0.008), (hub[0] - 0.005, 0.022), (hub[0] - 0.06, 0.006)]
        middle, half = (foot[2] + hub[2]) / 2, 0.42 * (hub[2] - foot[2])
        parts.append(body([(x, w, half, middle) for x, w in fairing], 4.0, stations=8, sides=8))
    return merge(*parts)


def _pylons(p: HelicopterParameters) -> Mesh:
    (fx, _, fz), (rx, _, rz) = (hub for hub, _ in _hubs(p))
    front = trapezoid((fx + 0.1, 0.0, 0.2 * p.cabin_height), (fx + 0.05, 0.0, fz - 0.01), 0.24, 0.12, 0.32, 0.0)
    half = p.fin_chord / 2
    rear = trapezoid((rx + 1.3 * half, 0.0, 0.0), (rx + 0.8 * half, 0.0, rz - 0.01), 2.3 * half, 1.7 * half, 0.24, 0.0)
    return merge(front, rear)


def _gear(p: HelicopterParameters) -> Mesh:
    floor = -0.48 * p.cabin_height
    ground, half = floor - p.gear_height, p.gear_width / 2
    front, rear = -0.28 * p.cabin_length, -0.66 * p.cabin_length
    if p.gear == "skids":
        bows = [tube((x, 0.25 * p.cabin_width, floor + 0.03), (x, half, ground), 0.008, sides=6) for x in (front, rear)]
        skid = polyline_tube(
            [(front + 0.1, half, ground + 0.035), (front + 0.06, half, ground), (rear - 0.09, half, ground)], 0.009
        )
        return both_sides(merge(*bows, skid))
    if p.gear == "tucked":
        return box((0.5 * (front + rear), 0.0, floor), (0.5 * abs(front - rear), 0.5 * p.cabin_width, 0.02))
    radius = 0.024
    main = rear if p.layout != "tandem" else -0.25
    leg = tube((main, 0.4 * p.cabin_width, floor + 0.06), (main, half, ground + radius), 0.01, sides=6)
    wheel = tube((main, half - 0.012, ground + radius), (main, half + 0.012, ground + radius), radius, sides=12)
    tail_x = -0.8 if p.layout != "coaxial" else front + 0.08
    low = floor + 0.06 if p.layout == "coaxial" else _boom_height(p, tail_x) if p.layout == "single" else floor + 0.04
    strut = tube((tail_x, 0.0, low), (tail_x, 0.0, ground + radius), 0.008, sides=6)
    small = tube((tail_x, -0.01, ground + radius), (tail_x, 0.01, ground + radius), 0.8 * radius, sides=12)
    return merge(both_sides(merge(leg, wheel)), strut, small)


def _stub_wings(p: HelicopterParameters) -> Mesh:
    x, half, z = -p.mast_place - 0.0, p.stub_wings / 2, -0.1 * p.cabin_height
    wing = trapezoid((x + 0.03, 0.0, z), (x, half, z - 0.02), 0.11, 0.08, 0.14, 0.02)
    pods = [_pod((x - 0.03, share * half, z - 0.045), 0.13, r) for share, r in ((0.68, 0.018), (0.95, 0.012))]
    chin = ellipsoid((-0.03, 0.0, -0.45 * p.cabin_height), (0.025, 0.02, 0.025), 6, 10)
    return merge(both_sides(merge(wing, *pods)), chin)


def _pod(centre: Vector, length: float, radius: float) -> Mesh:
    x, y, z = centre
    keys = [(length / 2, 0.1 * radius), (0.3 * length, radius), (-0.4 * length, radius), (-length / 2, 0.5 * radius)]
    return moved(body([(a, r, r, 0.0) for a, r in keys], stations=8, sides=8), (x, y, z))


def _sponson(p: HelicopterParameters) -> Mesh:
    length = p.sponsons
    x, y, z = -0.45, 0.52 * p.cabin_width, -0.32 * p.cabin_height
    keys = [(length / 2, 0.006), (0.25 * length, 0.032), (-0.25 * length, 0.034), (-length / 2, 0.006)]
    return moved(body([(a, r, 1.1 * r, 0.0) for a, r in keys], 2.6, stations=10, sides=10), (x, y, z))


def _rotors(p: HelicopterParameters, rng: np.random.Generator) -> list[Part]:
    radius, parts, phase = p.rotor_ratio / 2, [], float(rng.uniform(0, 360))
    for i, (hub, clockwise) in enumerate(_hubs(p)):
        chord = p.blade_chord * radius
        shape = RotorShape(p.blades, radius, chord, 0.9 * chord, (9.0, 4.0), 0.025, 0.03, p.coning, clockwise)
        axis = (float(np.sin(np.deg2rad(3.0 if p.layout != "coaxial" else 0.0))), 0.0, 1.0)
        # Intermeshing rotors keep half a blade spacing between them.
        start = phase + i * 180.0 / p.blades
        spin = Spin(hub, axis, p.hertz * (-1.0 if clockwise else 1.0), start)
        parts.append(Part(f"main_rotor_{i}", rotor(shape), 7, spin))
    if p.tail_rotor != "none":
        chord = (0.22 if p.tail_rotor == "open" else 0.2) * p.tail_radius
        shape = RotorShape(p.tail_blades, p.tail_radius, chord, 0.85 * chord, (14.0, 8.0), 0.012, 0.02)
        spin = Spin(_tail_hub(p), (0.0, 1.0, 0.0), p.hertz * p.tail_gearing, float(rng.uniform(0, 360)))
        parts.append(Part("tail_rotor", rotor(shape), 7, spin))
    return parts
