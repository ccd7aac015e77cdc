"""Helicopters with one, two tandem, two coaxial or two intermeshing rotors, put together from cabin to tail."""

from __future__ import annotations

import numpy as np

from aerojax.simulate.assets.helicopters.bodies import cargo, cowling, gear, glass, sponsons, stub_wings
from aerojax.simulate.assets.helicopters.layout import (
    HelicopterParameters,
    Hub,
    boom_height,
    cabin_keys,
    hubs,
    tail_hub,
)
from aerojax.simulate.assets.mesh.lofts import RotorShape, body, rotor, trapezoid
from aerojax.simulate.assets.mesh.parts import Part, Spin
from aerojax.simulate.assets.mesh.shapes import (
    Mesh,
    Vector,
    both_sides,
    box,
    merge,
    moved,
    polyline_tube,
    ring,
    rotation_about,
    tube,
)
from aerojax.simulate.usd.authoring import Asset, normalised


def build_helicopter(p: HelicopterParameters, rng: np.random.Generator) -> Asset:
    """Build the parts; `rng` draws only phases of the rotors and the length of the cycle."""
    cabin = cabin_keys(p)
    parts = [
        Part("cabin", body(cabin, p.cabin_exponent, stations=20), 0),
        Part("glass", glass(p, cabin), 1),
        Part("cowling", cowling(p), 2),
        Part("mast", merge(*(_mast(p, hub) for hub in hubs(p))), 4),
        Part("gear", gear(p), 5),
    ]
    if p.layout == "tandem":
        parts.append(Part("pylons", _pylons(p), 0))
    else:
        parts += [Part("boom", _boom(p), 0), Part("tail", _tail(p), 3)]
    if p.stub_wings > 0:
        parts.append(Part("stub_wings", stub_wings(p), 6))
    if p.sponsons > 0:
        parts.append(Part("sponsons", sponsons(p), 6))
    if p.cargo > 0:
        parts.append(Part("cargo", cargo(p), 6))
    length = float(np.ptp(np.concatenate([part.mesh.points[:, 0] for part in parts])))
    asset = Asset((*parts, *_rotors(p, rng)), cycle_seconds=float(rng.uniform(0.9, 1.1)))
    return normalised(asset, length)


def _between(start: Vector, end: Vector, share: float) -> Vector:
    x, y, z = ((1 - share) * a + share * b for a, b in zip(start, end, strict=True))
    return (x, y, z)


def _boom(p: HelicopterParameters) -> Mesh:
    start = -0.72 * p.cabin_length
    end = -0.985 if p.tail_rotor != "fenestron" else tail_hub(p)[0] + p.tail_radius + 0.012
    low, high = boom_height(p, start), boom_height(p, end)
    if p.boom == "truss":
        size = p.boom_root
        rails = [[(start, 0.0, low + size), (end, 0.0, high)]]
        rails += [[(start, s * size, low - 0.7 * size), (end, 0.0, high)] for s in (-1.0, 1.0)]
        bars = [polyline_tube(rail, 0.008, sides=6) for rail in rails]
        for share in np.linspace(0.1, 0.8, 6):
            a, b, c = (_between(rail[0], rail[1], float(share)) for rail in rails)
            bars.append(polyline_tube([a, b, c, a], 0.005, sides=4))
        return merge(*bars)
    if p.boom == "spine":
        keys = [(-0.35 * p.cabin_length, 0.7), (-p.mast_place, 1.25), (-0.65, 0.9)]
        beam = [(x, p.boom_root * w, p.boom_root * w, boom_height(p, x)) for x, w in keys]
        return body([*beam, (end, p.boom_tip, 1.2 * p.boom_tip, high)], 3.2, power=1.0, stations=12, sides=12)
    if p.boom == "rod":
        rod = tube((start, 0.0, low), (end, 0.0, high), p.boom_root, p.boom_tip)
        foot, far = (start, 0.25 * p.cabin_width, -0.2 * p.cabin_height), (-0.82, 0.0, boom_height(p, -0.82))
        return merge(rod, both_sides(tube(foot, far, 0.006, sides=6))) if p.struts else rod
    keys = [
        (start, 1.3 * p.boom_root, 1.6 * p.boom_root, low),
        (-p.cabin_length, p.boom_root, 1.15 * p.boom_root, boom_height(p, -p.cabin_length)),
        (end, p.boom_tip, 1.2 * p.boom_tip, high),
    ]
    return body(keys, 2.0, power=1.0, stations=10, sides=12)


def _tail(p: HelicopterParameters) -> Mesh:
    """Fins, tailplane, and what holds the tail rotor or replaces it."""
    high, chord = boom_height(p, -0.97), p.fin_chord
    front = -0.99 + chord
    # A fan takes the place of the fin's foot.
    gap = p.tail_radius + 0.012 if p.tail_rotor == "fenestron" else 0.0
    parts = []
    if p.fin_height > 0 and p.layout != "coaxial":
        tip = (front - p.fin_sweep * p.fin_height, 0.0, high + p.fin_height)
        parts.append(trapezoid((front, 0.0, high + gap), tip, chord, 0.6 * chord, 0.13, 0.0))
    if p.fin_below > 0 and p.layout != "coaxial":
        tip = (front - 0.5 * p.fin_below, 0.0, high - gap - p.fin_below)
        parts.append(trapezoid((front, 0.0, high - gap), tip, 0.9 * chord, 0.55 * chord, 0.13, 0.0))
    if p.stabiliser_span > 0:
        parts.append(both_sides(_stabiliser(p)))
    x, y, z = tail_hub(p)
    if p.tail_rotor == "fenestron":
        shroud = ring((0.0, 0.0, 0.0), p.tail_radius + 0.02, 0.045, 0.03, sides=20)
        parts.append(moved(shroud, (x, y, z), rotation_about((1.0, 0.0, 0.0), 90.0)))
        reach = p.tail_radius + 0.01
        parts.append(tube((x - reach, 0.015, z), (x + reach, 0.015, z), 0.006, sides=6))
    elif p.tail_rotor == "jet":
        parts.append(tube((-0.94, 0.0, high), (-0.99, 0.0, high), 1.25 * p.boom_tip, 1.6 * p.boom_tip, sides=14))
    elif p.tail_rotor == "open":
        parts.append(tube((x, 0.0, z), (x, y, z), 0.008, sides=6))
    return merge(*parts)


def _stabiliser(p: HelicopterParameters) -> Mesh:
    x = -p.stabiliser_place + p.stabiliser_chord / 2
    if p.fin_below > 0 and p.tail_rotor in ("open", "fenestron"):  # ahead of a rotor at the boom's height
        x = max(x, tail_hub(p)[0] + p.tail_radius + 0.02 + p.stabiliser_chord)
    z, half = boom_height(p, x), p.stabiliser_span / 2
    if p.stabiliser_height > 0:
        lift = p.stabiliser_height * p.fin_height
        x, z = -0.99 + p.fin_chord - p.fin_sweep * lift, boom_height(p, -0.97) + 0.97 * lift
    plane = trapezoid((x, 0.0, z), (x - 0.015, half, z), p.stabiliser_chord, 0.85 * p.stabiliser_chord, 0.12, 0.0)
    if p.end_plates == 0:
        return plane
    chord, height = 1.3 * p.stabiliser_chord, p.end_plates
    plate = trapezoid((x, half, z - 0.45 * height), (x - 0.03, half, z + 0.55 * height), chord, 0.7 * chord, 0.1, 0.0)
    return merge(plane, plate)


def _mast(p: HelicopterParameters, hub: Hub) -> Mesh:
    (x, y, z), (lean_x, lean_y, _) = hub.place, hub.axis
    depth = z - (0.3 * p.cabin_height if p.layout != "tandem" else z - 0.06)
    foot = (x - depth * lean_x, y - depth * lean_y, z - depth)
    parts = [tube(foot, (x + 0.012 * lean_x, y + 0.012 * lean_y, z + 0.012), 0.012, sides=8)]
    if p.layout == "single" and p.mast_height > 0.09:
        fairing = [(x + 0.02, 0.008), (x - 0.005, 0.022), (x - 0.06, 0.006)]
        middle, half = (foot[2] + z) / 2, 0.42 * depth
        parts.append(body([(a, w, half, middle) for a, w in fairing], 4.0, stations=8, sides=8))
    return merge(*parts)


def _pylons(p: HelicopterParameters) -> Mesh:
    (fx, _, fz), (rx, _, rz) = (hub.place for hub in hubs(p))
    front = trapezoid((fx + 0.1, 0.0, 0.2 * p.cabin_height), (fx + 0.05, 0.0, fz - 0.01), 0.24, 0.12, 0.32, 0.0)
    half = p.fin_chord / 2
    rear = trapezoid((rx + 1.3 * half, 0.0, 0.0), (rx + 0.8 * half, 0.0, rz - 0.01), 2.3 * half, 1.7 * half, 0.24, 0.0)
    return merge(front, rear)


def _flybar(p: HelicopterParameters, radius: float) -> Mesh:
    """A stabiliser bar across the blades, above the head, with a paddle at either end."""
    half, height = p.flybar * radius, 0.028
    paddle = box((0.9 * half, 0.0, height), (0.2 * half, 0.05, 0.008))
    stem = tube((0.0, 0.0, 0.0), (0.0, 0.0, height + 0.01), 0.007, sides=6)
    bar = tube((-half, 0.0, height), (half, 0.0, height), 0.004, sides=6)
    return merge(stem, bar, paddle, moved(paddle, (-1.8 * half, 0.0, 0.0)))


def _rotors(p: HelicopterParameters, rng: np.random.Generator) -> list[Part]:
    radius, parts, phase = p.rotor_ratio / 2, [], float(rng.uniform(0, 360))
    for i, hub in enumerate(hubs(p)):
        chord = p.blade_chord * radius
        shape = RotorShape(p.blades, radius, chord, 0.9 * chord, (9.0, 4.0), 0.025, 0.03, p.coning, hub.clockwise)
        mesh = merge(rotor(shape), _flybar(p, radius)) if p.flybar > 0 else rotor(shape)
        # Where discs overlap, a blade of the second is half a blade spacing away whenever one of the first passes: the
        # rotors turn against each other, so it is the sum of their phases that stays.
        start = 180.0 / p.blades - phase if i else phase
        spin = Spin(hub.place, hub.axis, p.hertz * (-1.0 if hub.clockwise else 1.0), start)
        parts.append(Part(f"main_rotor_{i}", mesh, 7, spin))
    if p.tail_rotor in ("open", "fenestron"):
        chord = (0.22 if p.tail_rotor == "open" else 0.2) * p.tail_radius
        shape = RotorShape(p.tail_blades, p.tail_radius, chord, 0.85 * chord, (14.0, 8.0), 0.012, 0.02)
        spin = Spin(tail_hub(p), (0.0, 1.0, 0.0), p.hertz * p.tail_gearing, float(rng.uniform(0, 360)))
        parts.append(Part("tail_rotor", rotor(shape), 7, spin))
    return parts
