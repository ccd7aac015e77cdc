"""Fixed-wing aircraft; lengths are fractions of the wing span.

Proportions follow real machines: length over span 0.75 (Cessna 172), 0.63 (Piper J-3), 1.05 (A320), 1.0 (business
jets), 1.5 (fighters), 0.42 (15 m gliders), 0.77 (biplanes). The wing is placed so that the quarter point of its mean
chord lies at the balance point.
"""

from __future__ import annotations

import numpy as np

from aerojax.simulate.assets.airplanes import rigging
from aerojax.simulate.assets.airplanes.engines import engines, propellers
from aerojax.simulate.assets.airplanes.shape import AirplaneParameters, wing_at, wing_root
from aerojax.simulate.assets.mesh.lofts import Key, Sections, body, surface, trapezoid
from aerojax.simulate.assets.mesh.shapes import Mesh, Vector, both_sides, merge, moved
from aerojax.simulate.usd.authoring import Asset, Part, normalised

UP = np.array([0.0, 0.0, 1.0])


def build_airplane(p: AirplaneParameters, rng: np.random.Generator) -> Asset:
    """Build the parts; `rng` draws only phases of the propellers and the length of the cycle."""
    wings = [_wing(p, 0.0)] if p.biplane_gap == 0 else [_wing(p, 0.0), _wing(p, p.biplane_gap)]
    parts = [
        Part("fuselage", body(_fuselage_keys(p), p.exponent, p.nose_power, 24), 0),
        Part("wings", merge(*wings), 0),
        Part("tail", _tail(p), 0),
    ]
    extras = [
        ("canopy", _canopy(p), 1),
        ("struts", rigging.struts(p), 2),
        ("gear", rigging.gear(p), 3),
        ("engines", engines(p), 4),
        ("booms", rigging.booms(p), 0),
        ("keel", rigging.keel(p), 2),
        ("floats", rigging.floats(p), 3),
        ("canard", _canard(p), 5),
    ]
    parts += [Part(name, mesh, role) for name, mesh, role in extras if mesh is not None]
    span = float(np.ptp(parts[1].mesh.points[:, 1]))
    return normalised(Asset((*parts, *propellers(p, rng)), cycle_seconds=float(rng.uniform(0.9, 1.1))), span)


def _fuselage_keys(p: AirplaneParameters) -> list[Key]:
    """Sections from the nose at x = 0 to the tail at x = -length."""
    w, h, length = p.width / 2, p.height / 2, p.fuselage_length
    rise = (0.2 if p.keel else p.tail_rise) * h
    blunt = 0.55 if p.power == "nose" else 0.05
    droop = 0.75 * (1 - p.nose_fullness) if p.power == "nose" else 0.1  # the cowling continues the belly line
    return [
        (0.0, blunt * p.nose_fullness * w, blunt * p.nose_fullness * h, -0.02 * h - droop * h),
        (-0.1 * length, p.nose_fullness * w, p.nose_fullness * h, -droop * h),
        (-0.28 * length, w, h, 0.0),
        (-p.cabin_end * length, 0.97 * w, 0.95 * h, 0.03 * h),
        (-0.5 * (1 + p.cabin_end) * length, 0.55 * w, 0.6 * h, 0.03 * h + 0.45 * rise),
        (-length, 0.1 * w, 0.14 * h, rise),
    ]


def _wing(p: AirplaneParameters, lift: float) -> Mesh:
    share = np.array([0.0, 0.2, 0.4, 0.55, 0.68, 0.82, 0.93, 0.98, 1.0])
    edge, chord = wing_at(p, share)
    square, rounded = np.array([1, 1, 1, 1, 1, 1, 1, 0.93, 0.7]), np.array([1, 1, 1, 1, 1, 0.97, 0.8, 0.52, 0.2])
    shrink = (1 - p.tip_round) * square + p.tip_round * rounded
    edge[:, 0] -= 0.5 * chord * (1 - shrink)
    edge += np.array([p.stagger if lift > 0 else 0.0, 0.0, lift])
    twist = 2.0 - 2.5 * share
    panel = surface(Sections(edge, chord * shrink, UP, p.thickness * shrink, 0.025, twist), points=7)
    if p.winglet > 0:
        tip, last = edge[-2], float(chord[-1])
        root: Vector = (float(tip[0]) - 0.15 * last, float(tip[1]) - 0.003, float(tip[2]))
        end: Vector = (root[0] - 0.9 * p.winglet, root[1] + 0.25 * p.winglet, root[2] + p.winglet)
        panel = merge(panel, trapezoid(root, end, 0.8 * last, 0.4 * last, 0.1, 0.0))
    return both_sides(panel)


def _canopy(p: AirplaneParameters) -> Mesh | None:
    """Cockpit hood; `canopy` is its height over the fuselage's."""
    if p.canopy == 0:
        return None
    start, end = -0.17 * p.length, -(p.cabin_end + 0.02) * p.length
    top, rise = 0.5 * p.height, p.canopy * p.height
    keys = [
        (start, 0.12 * p.width, 0.1 * rise, 0.82 * top),
        (start + 0.3 * (end - start), 0.4 * p.width, 0.85 * rise, 0.82 * top),
        (start + 0.6 * (end - start), 0.4 * p.width, 0.9 * rise, 0.82 * top),
        (end, 0.1 * p.width, 0.1 * rise, 0.8 * top),
    ]
    return body(keys, 2.6, stations=14, sides=14)


def _tail(p: AirplaneParameters) -> Mesh:
    if p.tail == "none":
        return both_sides(_end_fin(p)) if p.fin_height > 0 else _trailing_tip(p)
    z = p.tail_height
    x, half = -p.length + p.fin_chord, p.tail_span / 2
    back = float(np.tan(np.deg2rad(p.tail_sweep)))
    fin_top: Vector = (x - 1.1 * back * p.fin_height - 0.1 * p.fin_chord, 0.0, z + p.fin_height)
    fin = trapezoid((x, 0.0, z - 0.02), fin_top, p.fin_chord, 0.55 * p.fin_chord, 0.1, 0.0)
    if p.tail == "v":
        tip = (x - back * half, half * 0.8, z + 0.75 * half)
        return both_sides(trapezoid((x, 0.0, z), tip, p.tail_chord, 0.6 * p.tail_chord, 0.1, 0.0))
    lift = {"t": 0.96, "cruciform": 0.45}.get(p.tail, 0.0)
    root = (x - lift * (1.1 * back * p.fin_height + 0.1 * p.fin_chord), 0.0, z + lift * p.fin_height)
    if p.tail in ("twin", "h", "boom"):
        side = {"boom": p.booms, "h": half, "twin": 0.4 * p.width}[p.tail]
        fin = both_sides(moved(fin, (0.0, side, 0.0)))
    plane_tip = (root[0] - back * half, half, root[2] + 0.02)
    plane = trapezoid(root, plane_tip, p.tail_chord, 0.6 * p.tail_chord, 0.1, 0.0)
    return merge(fin, both_sides(plane))


def _end_fin(p: AirplaneParameters) -> Mesh:
    """Fins near the wing tips of a tailless airplane."""
    edge, chord = wing_at(p, np.array([0.97]))
    x, y, z = (float(v) for v in edge[0])
    height, size = p.fin_height, 1.1 * float(chord[0])
    tip = (x - 0.1 * size - 0.5 * height, y + 0.01, z + height)
    return trapezoid((x - 0.1 * size, y, z - 0.2 * height), tip, size, 0.6 * size, 0.1, 0.0)


def _trailing_tip(p: AirplaneParameters) -> Mesh:
    """The centre body's trailing edge of an airplane without any fin."""
    x, z = wing_root(p)
    chord = 0.9 * p.root_chord
    return both_sides(
        trapezoid((x - 0.35 * chord, 0.0, z), (x - 0.6 * chord, 0.09, z), 0.8 * chord, 0.45 * chord, 0.08, 0.0)
    )


def _canard(p: AirplaneParameters) -> Mesh | None:
    if p.canard == 0:
        return None
    half, x = p.canard / 2, -0.12 * p.length
    back = 0.8 * half * float(np.tan(np.deg2rad(min(p.sweep, 45.0))))
    z = 0.1 * p.height
    return both_sides(trapezoid((x, 0.0, z), (x - back, half, z), 0.32 * p.canard, 0.18 * p.canard, 0.1, 0.02))
