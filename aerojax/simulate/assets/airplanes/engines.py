"""What drives an airplane: jets, pods, nacelles and propellers."""

from __future__ import annotations

import numpy as np

from aerojax.simulate.assets.airplanes.shape import AirplaneParameters, wing_at, wing_root
from aerojax.simulate.assets.mesh.lofts import RotorShape, body, rotor, trapezoid
from aerojax.simulate.assets.mesh.shapes import Mesh, Vector, both_sides, ellipsoid, merge, moved, tube
from aerojax.simulate.usd.authoring import Part, Spin


def _engine_places(p: AirplaneParameters) -> list[Vector]:
    """Fronts of the engines on the left side, or on the axis."""
    if p.power == "nose":
        return [(0.0, 0.0, -0.06 * p.height)]
    if p.power == "pusher":
        return [(-p.fuselage_length, 0.0, p.tail_height)]
    if p.power == "overhead":  # behind the wing's middle and clear of the keel
        x, z = wing_root(p)
        return [(x - 1.02 * p.root_chord, 0.0, z + p.propeller_radius + 0.02)]
    if p.power == "rear_pods":
        return [(-0.72 * p.length, 0.5 * p.width + 0.85 * p.engine_size, 0.25 * p.height)]
    if p.power in ("wing_propellers", "pods"):
        shares = np.linspace(0.31, 0.31 + 0.23 * (p.engines - 1), p.engines)
        edge, _ = wing_at(p, shares)
        drop = 1.25 * p.engine_size if p.power == "pods" else 0.1 * p.engine_size
        ahead = 1.9 * p.engine_size if p.power == "pods" else 3.0 * p.engine_size
        return [(float(a) + ahead, float(b), float(c) - drop) for a, b, c in edge]
    return []


def engines(p: AirplaneParameters) -> Mesh | None:
    """Spinners, nozzles, intakes, pods with their pylons or nacelles, as `power` says."""
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
        one = body([(x, w, w, 0.0) for x, w in keys], 2.0, 1.0, 12, 14)
        aside = (1.02 * r, -1.02 * r) if p.pod_pair else (0.0,)
        pods = [moved(one, (x, y + shift, z)) for x, y, z in places for shift in aside]
        pylons = [_pylon(p, place) for place in places]
        return both_sides(merge(*pods, *pylons))
    if p.power == "overhead":
        (x, _, z), (_, wing) = places[0], wing_root(p)
        block = ellipsoid((x + 0.028, 0.0, z), (0.034, 0.022, 0.026))
        legs = [tube((x + a, 0.0, z), (x + b, 0.0, wing), 0.006, sides=6) for a, b in ((0.04, 0.06), (0.02, 0.0))]
        return merge(block, *legs)
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


def propellers(p: AirplaneParameters, rng: np.random.Generator) -> list[Part]:
    """Propellers at their engines, each at its own rate and phase."""
    if p.power not in ("nose", "pusher", "overhead", "wing_propellers"):
        return []
    ahead = 0.03 if p.power not in ("pusher", "overhead") else -0.015
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
