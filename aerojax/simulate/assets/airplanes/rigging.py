"""What hangs on an airplane: struts, wires, wheels, floats and the tubes that carry its tail."""

from __future__ import annotations

import numpy as np

from aerojax.simulate.assets.airplanes.shape import AirplaneParameters, wing_at, wing_root
from aerojax.simulate.assets.mesh.lofts import body
from aerojax.simulate.assets.mesh.shapes import Mesh, Vector, both_sides, merge, moved, polyline_tube, tube

_STRUT = np.array([0.55])
"""Share of the half span at which struts and wires meet the wing."""


def struts(p: AirplaneParameters) -> Mesh | None:
    """Struts from the fuselage to the wings or between two wings; None without."""
    if not p.struts:
        return None
    edge, chord = wing_at(p, _STRUT)
    x, y, z = float(edge[0, 0]) - 0.3 * float(chord[0]), float(edge[0, 1]), float(edge[0, 2])
    if p.biplane_gap > 0:
        top = z + p.biplane_gap
        pairs = [((x + 0.05, y, z), (x + 0.05 + p.stagger, y, top)), ((x - 0.05, y, z), (x - 0.05 + p.stagger, y, top))]
        pairs += [((a, 0.02, z), (a + p.stagger, 0.06, top)) for a in (x + 0.04, x - 0.05)]
        return both_sides(merge(*(tube(a, b, 0.005, sides=6) for a, b in pairs)))
    foot = (x - 0.01, 0.35 * p.width, -0.42 * p.height)
    return both_sides(merge(tube(foot, (x + 0.03, y, z), 0.006, sides=6), tube(foot, (x - 0.05, y, z), 0.005, sides=6)))


def gear(p: AirplaneParameters) -> Mesh | None:
    """Fixed legs and wheels, the third under the nose or the tail; None when retracted."""
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


def floats(p: AirplaneParameters) -> Mesh | None:
    """Two floats with upturned bows under the fuselage, on four legs each side and two spreader bars."""
    if p.floats == 0:
        return None
    n, y, radius = p.floats, 0.12, 0.052 * p.floats
    z = -0.45 * p.height - max(0.06, 0.8 * p.propeller_radius)
    bow = -p.balance * p.length + 0.55 * n
    keys = [
        (bow, 0.15 * radius, 0.15 * radius, z + 0.75 * radius),
        (bow - 0.15 * n, 0.85 * radius, 0.75 * radius, z + 0.25 * radius),
        (bow - 0.5 * n, radius, radius, z),
        (bow - 0.6 * n, 0.9 * radius, 0.75 * radius, z + 0.25 * radius),
        (bow - n, 0.2 * radius, 0.25 * radius, z + 0.75 * radius),
    ]
    parts, width, floor = [moved(body(keys, 3.0, 1.5, 18, 12), (0.0, y, 0.0))], 0.3 * p.width, -0.38 * p.height
    for share in (0.32, 0.62):
        x = bow - share * n
        parts.append(tube((x, y, z), (x, width, floor), 0.006, sides=6))
        parts.append(tube((x - 0.06, y, z), (x, width, floor), 0.005, sides=6))
    bars = [tube((bow - s * n, -y, z), (bow - s * n, y, z), 0.005, sides=6) for s in (0.32, 0.62)]
    return merge(both_sides(merge(*parts)), *bars)


def booms(p: AirplaneParameters) -> Mesh | None:
    """Two booms from the wing to the tail; None without."""
    if p.booms == 0:
        return None
    x, z = wing_root(p)
    start: Vector = (x - 0.1 * p.root_chord, p.booms, z)
    return both_sides(polyline_tube([start, (-p.length, p.booms, p.tail_height)], 0.014))


def keel(p: AirplaneParameters) -> Mesh | None:
    """The tube of an ultralight from before its wing to the tail, what its seat hangs on, king post and wires."""
    if not p.keel:
        return None
    (x, z), half = wing_root(p), 0.3 * p.height
    front: Vector = (x + 0.06, 0.0, z)
    end: Vector = (-p.length, 0.0, p.tail_height)
    post: Vector = (x - 0.3 * p.root_chord, 0.0, z + 0.1)
    edge, chord = wing_at(p, _STRUT)
    wing = (float(edge[0, 0] - 0.3 * chord[0]), float(edge[0, 1]), float(edge[0, 2]))
    tubes = [tube(front, end, 0.009, 0.007), tube((post[0], 0.0, z), post, 0.005, sides=6)]
    tubes += [tube(post, stay, 0.0025, sides=6) for stay in (front, (end[0] + p.fin_chord, 0.0, end[2]))]
    tubes += [tube(post, (wing[0], side * wing[1], wing[2]), 0.0025, sides=6) for side in (1.0, -1.0)]
    seat = -0.5 * p.fuselage_length
    hangers = [
        tube((seat + a, 0.3 * p.width, half), (x - b, 0.01, z), 0.006, sides=6) for a, b in ((0.1, 0.0), (-0.05, 0.1))
    ]
    return merge(*tubes, both_sides(merge(*hangers)))
