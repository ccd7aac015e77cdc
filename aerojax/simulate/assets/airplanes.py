"""Fixed-wing aircraft; lengths are fractions of the wing span.

Proportions follow real machines: length over span 0.75 (Cessna 172), 0.63 (Piper J-3), 1.05 (A320), 1.0 (business
jets), 1.5 (fighters), 0.42 (15 m gliders), 0.77 (biplanes). The wing is placed so that the quarter point of its mean
chord lies at the balance point.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from aerojax.simulate.assets.airplane_families import FAMILIES
from aerojax.simulate.assets.authoring import Asset, Part, Spin, normalised
from aerojax.simulate.assets.lofts import Key, RotorShape, Sections, body, rotor, surface, trapezoid
from aerojax.simulate.assets.shapes import Mesh, Vector, both_sides, ellipsoid, merge, moved, polyline_tube, tube
from aerojax.simulate.assets.variation import draw

UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class AirplaneParameters:
    """Shape of an airplane; lengths over the wing span, angles in degrees.

    wing_height: of the wing's root over the fuselage's half height; ±1 is roof or belly.
    balance: share of the length, from the nose, at which the wing's mean quarter chord lies.
    straight_share: share of the half span with constant chord. tip_round: 0 square to 1 rounded.
    pod: share of the length that the fuselage takes between twin booms.
    """

    length: float
    width: float
    height: float
    exponent: float
    nose_power: float
    nose_fullness: float
    cabin_end: float
    tail_rise: float
    canopy: float
    wing_height: float
    balance: float
    root_chord: float
    taper: float
    straight_share: float
    sweep: float
    dihedral: float
    tip_dihedral: float
    thickness: float
    winglet: float
    tip_round: float
    tail: str
    tail_span: float
    tail_chord: float
    fin_height: float
    fin_chord: float
    tail_sweep: float
    power: str
    engines: int
    engine_size: float
    blades: int
    propeller_radius: float
    hertz: float
    gear: str
    struts: bool = False
    biplane_gap: float = 0.0
    stagger: float = 0.0
    canard: float = 0.0
    booms: float = 0.0
    pod: float = 0.62


def draw_parameters(family: str, rng: np.random.Generator) -> AirplaneParameters:
    """Draw one airplane of a family."""
    return draw(AirplaneParameters, FAMILIES[family], rng)


def author(p: AirplaneParameters, rng: np.random.Generator) -> Asset:
    """Build the parts; `rng` draws only phases of the propellers and the length of the cycle."""
    wings = [_wing(p, 0.0)] if p.biplane_gap == 0 else [_wing(p, 0.0), _wing(p, p.biplane_gap)]
    parts = [
        Part("fuselage", body(_fuselage_keys(p), p.exponent, p.nose_power, 24), 0),
        Part("wings", merge(*wings), 0),
        Part("tail", _tail(p), 0),
    ]
    extras = [
        ("canopy", _canopy(p), 1),
        ("struts", _struts(p), 2),
        ("gear", _gear(p), 3),
        ("engines", _engines(p), 4),
        ("booms", _booms(p), 0),
        ("canard", _canard(p), 5),
    ]
    parts += [Part(name, mesh, role) for name, mesh, role in extras if mesh is not None]
    span = float(np.ptp(parts[1].mesh.points[:, 1]))
    return normalised(Asset((*parts, *_propellers(p, rng)), cycle_seconds=float(rng.uniform(0.9, 1.1))), span)


def _fuselage_keys(p: AirplaneParameters) -> list[Key]:
    """Sections from the nose at x = 0 to the tail at x = -length."""
    w, h, length = p.width / 2, p.height / 2, p.length * (p.pod if p.booms > 0 else 1.0)
    blunt = 0.55 if p.power == "nose" else 0.05
    droop = 0.75 * (1 - p.nose_fullness) if p.power == "nose" else 0.1  # the cowling continues the belly line
    return [
        (0.0, blunt * p.nose_fullness * w, blunt * p.nose_fullness * h, -0.02 * h - droop * h),
        (-0.1 * length, p.nose_fullness * w, p.nose_fullness * h, -droop * h),
        (-0.28 * length, w, h, 0.0),
        (-p.cabin_end * length, 0.97 * w, 0.95 * h, 0.03 * h),
        (-0.5 * (1 + p.cabin_end) * length, 0.55 * w, 0.6 * h, 0.03 * h + 0.45 * p.tail_rise * h),
        (-length, 0.1 * w, 0.14 * h, p.tail_rise * h),
    ]


def _wing_root(p: AirplaneParameters) -> tuple[float, float]:
    """x and z of the leading edge at the plane of symmetry."""
    mean = p.root_chord * (1 + p.taper * (1 - p.straight_share) + p.straight_share) / 2
    y_mean = 0.22 if p.taper < 0.8 else 0.25
    x = -p.balance * p.length + 0.25 * mean + y_mean * float(np.tan(np.deg2rad(p.sweep)))
    return x, 0.5 * p.wing_height * p.height


def _wing_at(
    p: AirplaneParameters, share: Float[np.ndarray, "n"]
) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n"]]:
    """Leading edge and chord of the left wing at shares of the half span."""
    x, z = _wing_root(p)
    y = 0.5 * share
    fall = np.clip((share - p.straight_share) / (1 - p.straight_share + 1e-9), 0, 1)
    chord = p.root_chord * (1 - (1 - p.taper) * fall)
    outer = np.clip(y - 0.33, 0, None)
    rise = np.tan(np.deg2rad(p.dihedral)) * y + np.tan(np.deg2rad(p.tip_dihedral)) * outer
    back = np.tan(np.deg2rad(p.sweep)) * y
    if p.straight_share > 0:
        back = back + 0.4 * (p.root_chord - chord)
    return np.stack([x - back, y, z + rise], axis=1), chord


def _wing(p: AirplaneParameters, lift: float) -> Mesh:
    share = np.array([0.0, 0.2, 0.4, 0.55, 0.68, 0.82, 0.93, 0.98, 1.0])
    edge, chord = _wing_at(p, share)
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
    z = 0.5 * p.tail_rise * p.height
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
    edge, chord = _wing_at(p, np.array([0.97]))
    x, y, z = (float(v) for v in edge[0])
    height, size = p.fin_height, 1.1 * float(chord[0])
    tip = (x - 0.1 * size - 0.5 * height, y + 0.01, z + height)
    return trapezoid((x - 0.1 * size, y, z - 0.2 * height), tip, size, 0.6 * size, 0.1, 0.0)


def _trailing_tip(p: AirplaneParameters) -> Mesh:
    """The centre body's trailing edge of an airplane without any fin."""
    x, z = _wing_root(p)
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


def _struts(p: AirplaneParameters) -> Mesh | None:
    if not p.struts:
        return None
    edge, chord = _wing_at(p, np.array([0.55]))
    x, y, z = float(edge[0, 0]) - 0.3 * float(chord[0]), float(edge[0, 1]), float(edge[0, 2])
    if p.biplane_gap > 0:
        top = z + p.biplane_gap
        pairs = [((x + 0.05, y, z), (x + 0.05 + p.stagger, y, top)), ((x - 0.05, y, z), (x - 0.05 + p.stagger, y, top))]
        pairs += [((a, 0.02, z), (a + p.stagger, 0.06, top)) for a in (x + 0.04, x - 0.05)]
        return both_sides(merge(*(tube(a, b, 0.005, sides=6) for a, b in pairs)))
    foot = (x - 0.01, 0.35 * p.width, -0.42 * p.height)
    return both_sides(merge(tube(foot, (x + 0.03, y, z), 0.006, sides=6), tube(foot, (x - 0.05, y, z), 0.005, sides=6)))


def _gear(p: AirplaneParameters) -> Mesh | None:
    if p.gear == "none":
        return None
    x_wing = -p.balance * p.length
    radius = 0.022 if p.length < 0.95 else 0.016
    floor = -0.45 * p.height
    ground = floor - max(0.075, 0.8 * p.propeller_radius)
    tail_dragger = p.gear == "tail_wheel"
    x, y = x_wing + (0.1 if tail_dragger else -0.04), 0.1
    leg = tube((x - 0.01, 0.3 * p.width, floor + 0.015), (x, y, ground), 0.007, sides=6)
    wheel = tube((x, y - 0.008, ground), (x, y + 0.008, ground), radius, sides=12)
    third = -0.93 * p.length if tail_dragger else -0.12 * p.length
    end = 0.35 * p.tail_rise * p.height - 0.045 if tail_dragger else ground
    size = 0.5 * radius if tail_dragger else radius
    top = 0.4 * p.tail_rise * p.height if tail_dragger else floor + 0.02
    single = merge(
        tube((third, 0.0, top), (third, 0.0, end), 0.006, sides=6),
        tube((third, -0.006, end), (third, 0.006, end), size, sides=10),
    )
    return merge(both_sides(merge(leg, wheel)), single)


def _engine_places(p: AirplaneParameters) -> list[Vector]:
    """Fronts of the engines on the left side, or on the axis."""
    if p.power == "nose":
        return [(0.0, 0.0, -0.06 * p.height)]
    if p.power == "pusher":
        return [(-p.length * (p.pod if p.booms > 0 else 1.0), 0.0, 0.5 * p.tail_rise * p.height)]
    if p.power == "rear_pods":
        return [(-0.72 * p.length, 0.5 * p.width + 0.85 * p.engine_size, 0.25 * p.height)]
    if p.power in ("wing_propellers", "pods"):
        shares = np.linspace(0.31, 0.31 + 0.23 * (p.engines - 1), p.engines)
        edge, _ = _wing_at(p, shares)
        drop = 1.25 * p.engine_size if p.power == "pods" else 0.1 * p.engine_size
        ahead = 1.9 * p.engine_size if p.power == "pods" else 3.0 * p.engine_size
        return [(float(a) + ahead, float(b), float(c) - drop) for a, b, c in edge]
    return []


def _engines(p: AirplaneParameters) -> Mesh | None:
    r, places = p.engine_size, _engine_places(p)
    if p.power == "nose":
        return ellipsoid(
            (0.012, 0.0, -0.06 * p.height), (0.035, 0.3 * p.width * p.nose_fullness, 0.3 * p.width * p.nose_fullness)
        )
    if p.power == "jet":
        if p.engine_size == 0:
            return tube((-0.97 * p.length, 0.0, 0.0), (-1.02 * p.length, 0.0, 0.0), 0.3 * p.width, 0.24 * p.width, 12)
        inlet = [
            (-0.3 * p.length, 0.9 * r, r, 0.0),
            (-0.42 * p.length, r, r, 0.0),
            (-0.85 * p.length, 0.5 * r, 0.5 * r, 0.0),
        ]
        return both_sides(moved(body(inlet, 3.0, 1.0, 10, 12), (0.0, 0.45 * p.width, -0.1 * p.height)))
    if p.power in ("pods", "rear_pods"):
        keys = [(0.0, 0.85 * r), (-0.7 * r, r), (-2.4 * r, 0.92 * r), (-4.0 * r, 0.5 * r)]
        pods = [moved(body([(x, w, w, 0.0) for x, w in keys], 2.0, 1.0, 12, 14), place) for place in places]
        pylons = [_pylon(p, place) for place in places]
        return both_sides(merge(*pods, *pylons))
    if p.power == "wing_propellers":
        keys = [(0.035, 0.2 * r), (0.0, 0.75 * r), (-1.5 * r, r), (-5.0 * r, 0.85 * r), (-8.0 * r, 0.12 * r)]
        return both_sides(
            merge(*(moved(body([(x, w, 1.1 * w, 0.0) for x, w in keys], 2.2, 2.0, 14, 12), q) for q in places))
        )
    return None


def _pylon(p: AirplaneParameters, place: Vector) -> Mesh:
    x, y, z = place
    r = p.engine_size
    if p.power == "rear_pods":
        return trapezoid((x - r, 0.3 * p.width, z), (x - 1.2 * r, y, z), 2.4 * r, 2.0 * r, 0.16, 0.0)
    return trapezoid((x - 0.8 * r, y, z), (x - 2.2 * r, y, z + 1.5 * r), 2.6 * r, 2.2 * r, 0.12, 0.0)


def _booms(p: AirplaneParameters) -> Mesh | None:
    if p.booms == 0:
        return None
    x, z = _wing_root(p)
    tail = 0.5 * p.tail_rise * p.height
    return both_sides(polyline_tube([(x - 0.1 * p.root_chord, p.booms, z), (-p.length, p.booms, tail)], 0.014))


def _propellers(p: AirplaneParameters, rng: np.random.Generator) -> list[Part]:
    if p.power not in ("nose", "pusher", "wing_propellers"):
        return []
    ahead = 0.03 if p.power != "pusher" else -0.015
    left = [(x + ahead, y, z) for x, y, z in _engine_places(p)]
    hubs = left + [(x, -y, z) for x, y, z in left if y > 0]
    chord = 0.15 * p.propeller_radius
    shape = RotorShape(p.blades, p.propeller_radius, chord, 0.7 * chord, (38.0, 16.0), 0.012, 0.02, 0.0, True)
    parts = []
    for i, hub in enumerate(hubs):
        hertz = -p.hertz * float(rng.uniform(0.98, 1.02))
        parts.append(
            Part(f"propeller_{i}", rotor(shape), 6, Spin(hub, (1.0, 0.0, 0.0), hertz, float(rng.uniform(0, 360))))
        )
    return parts
