"""What a multicopter's frame carries: hull, landing gear, camera, battery, masts, payloads, booms and fins."""

from __future__ import annotations

import numpy as np

from aerojax.simulate.assets.mesh.lofts import Key, body, trapezoid
from aerojax.simulate.assets.mesh.shapes import (
    Mesh,
    Vector,
    both_sides,
    box,
    ellipsoid,
    merge,
    moved,
    polyline_tube,
    rotation_about,
    tube,
)
from aerojax.simulate.assets.multicopters.layout import (
    MulticopterParameters,
    clear_radius,
    hull_top,
    hull_under,
)


def hull(p: MulticopterParameters) -> Mesh:
    """The central body: a shell ("dome", "egg", "fuselage", "slab"), a "box", one "plate" or a "stack" of two."""
    length, width, height = p.hull_length / 2, p.hull_width / 2, p.hull_height / 2
    if p.hull in _SHELLS:
        keys = [(x * length, w * width, h * height, z * height) for x, w, h, z in _SHELLS[p.hull]]
        return body(keys, exponent=_EXPONENTS.get(p.hull, 2.2), stations=14, sides=16)
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


_EXPONENTS = {"dome": 2.6, "slab": 4.0}

_SHELLS: dict[str, list[Key]] = {
    "dome": [
        (-1.0, 0.25, 0.3, 0.1),
        (-0.6, 0.85, 0.8, 0.15),
        (0.15, 1.0, 1.0, 0.0),
        (0.75, 0.75, 0.7, -0.1),
        (1.0, 0.3, 0.25, -0.1),
    ],
    "egg": [
        (-1.0, 0.05, 0.05, 0.2),
        (-0.7, 0.55, 0.55, 0.15),
        (-0.1, 0.95, 0.98, 0.0),
        (0.3, 1.0, 1.0, 0.0),
        (0.75, 0.7, 0.68, -0.1),
        (1.0, 0.08, 0.08, -0.2),
    ],
    "fuselage": [
        (-1.0, 0.1, 0.12, 0.45),
        (-0.45, 0.5, 0.5, 0.25),
        (0.1, 1.0, 0.95, 0.0),
        (0.5, 1.0, 1.0, 0.0),
        (0.85, 0.6, 0.55, -0.2),
        (1.0, 0.08, 0.08, -0.35),
    ],
    "slab": [
        (-1.0, 0.55, 0.5, 0.1),
        (-0.8, 0.85, 0.8, 0.1),
        (-0.1, 1.0, 1.0, 0.0),
        (0.6, 0.9, 0.9, 0.0),
        (0.9, 0.75, 0.7, -0.1),
        (1.0, 0.5, 0.4, -0.15),
    ],
}
"""Sections over half length, half width and half height of the hull."""


def _plate(length: float, width: float, thickness: float) -> Mesh:
    """A flat deck with bevelled corners."""
    keys = [(-length, 0.55 * width), (-0.7 * length, width), (0.7 * length, width), (length, 0.55 * width)]
    return body([(x, w, thickness / 2, 0.0) for x, w in keys], exponent=8.0, power=1.0, stations=6, sides=8)


def fittings(p: MulticopterParameters, motors: list[Vector]) -> list[tuple[str, Mesh, int]]:
    """Name, mesh and colour role of everything that this machine carries."""
    battery = box((-0.05 * p.hull_length, 0.0, hull_top(p) + 0.025), (0.6 * p.hull_length, p.battery, 0.06))
    found = [
        ("battery", battery if p.battery > 0 else None, 4),
        ("gimbal", _gimbal(p) if p.gimbal > 0 else None, 5),
        ("masts", _masts(p), 4),
        ("legs", _legs(p, motors), 6),
        ("payload", _payload(p), 7),
        ("glass", _glass(p) if p.hull == "egg" else None, 1),
        ("roof", _roof(p), 5),
        ("boom", _spray_boom(p) if p.boom_span > 0 else None, 4),
        ("tail", _tail(p), 0),
    ]
    return [(name, mesh, role) for name, mesh, role in found if mesh is not None]


def _gimbal(p: MulticopterParameters) -> Mesh:
    size, front = p.gimbal, 0.36 * p.hull_length
    top = hull_under(p) + (0.12 * p.hull_height if p.hull == "dome" else 0.0)
    low = top - 0.65 * size
    ball = ellipsoid((front, 0.0, low), (0.5 * size, 0.45 * size, 0.45 * size))
    lens = tube((front, 0.0, low), (front + 0.65 * size, 0.0, low - 0.03 * size), 0.25 * size)
    return merge(ball, lens, box((front, 0.0, top - 0.15 * size), (0.5 * size, 0.8 * size, 0.5 * size)))


def _masts(p: MulticopterParameters) -> Mesh | None:
    """Antennas that lean back and the mast of a satellite receiver, all clear of the propellers."""
    clear = clear_radius(p)
    tip, x, top = -min(0.55 * p.hull_length, 0.9 * clear), -0.2 * p.hull_length, hull_top(p) + p.gps_mast
    root = max(0.73 * tip, -0.25 * p.hull_length)
    masts = [polyline_tube([(root, float(y), 0.0), (tip, 1.3 * float(y), 0.2)], 0.008, sides=6)
             for y in np.linspace(-0.3, 0.3, p.antennas) * min(0.2, p.hull_width)] if p.antennas else []  # fmt: skip
    if p.gps_mast > 0:
        x, y = max(x, -0.6 * clear), min(0.05, 0.3 * clear)
        masts += [tube((x, y, 0.0), (x, y, top), 0.008, sides=6)]
        masts += [tube((x, y, top), (x, y, top + 0.02), 0.045)]
    return merge(*masts) if masts else None


def _legs(p: MulticopterParameters, motors: list[Vector]) -> Mesh | None:
    under, radius = hull_under(p), 0.014
    foot = under - p.leg_height
    if p.legs == "none":
        return None
    if p.legs == "motor_posts":
        return merge(*(tube((x, y, z), (x, y, z - p.leg_height), 0.016, 0.01, sides=6) for x, y, z in motors))
    x, y = 0.3 * p.hull_length, 0.38 * p.hull_width
    spread = y + 0.35 * p.leg_height
    if p.legs == "retracted":
        # Swung out and up beside the hull, clear of the camera's view.
        knee, tip = (0.0, y + 0.8 * p.leg_height, under - 0.02), 0.35 * p.leg_height
        return both_sides(merge(tube((0.0, 0.7 * y, 0.0), knee, radius, sides=6),
                                tube((-tip, *knee[1:]), (tip, *knee[1:]), radius, sides=6)))  # fmt: skip
    struts = [tube((a, 0.7 * y, 0.0), (1.3 * a, spread, foot), radius, sides=6) for a in (-x, x)]
    if p.legs == "skids":
        reach = x * 1.3 + 0.08
        struts.append(tube((-reach, spread, foot), (reach, spread, foot), radius * 1.1, sides=6))
    return both_sides(merge(*struts))


def _payload(p: MulticopterParameters) -> Mesh | None:
    size, under = p.payload_size, hull_under(p)
    if p.payload == "box":
        return box((0.0, 0.0, under - 0.35 * size), (1.2 * size, size, 0.7 * size))
    if p.payload == "tank":
        return ellipsoid((0.0, 0.0, under - 0.4 * size), (0.75 * size, 0.65 * size, 0.45 * size))
    if p.payload == "bottle":
        low = under - 0.3 * size
        return tube((0.0, -0.7 * size, low), (0.0, 0.7 * size, low), 0.28 * size, sides=14)
    if p.payload == "sling":
        low = under - p.tether
        line = tube((0.0, 0.0, under + 0.02), (0.0, 0.0, low - 0.02), 0.007, sides=6)
        slings = [tube((0.0, 0.0, low), (a * size, b * size, low - 0.4 * size), 0.006, sides=6)
                  for a in (-0.45, 0.45) for b in (-0.4, 0.4)]  # fmt: skip
        return merge(line, *slings, box((0.0, 0.0, low - 0.7 * size), (size, 0.9 * size, 0.7 * size)))
    return None


def _glass(p: MulticopterParameters) -> Mesh:
    """Canopy of a passenger hull: the front of the egg, a little larger."""
    length, width, height = p.hull_length / 2, p.hull_width / 2, p.hull_height / 2
    keys = [(x * length, w * width, h * height, z * height)
            for x, w, h, z in ((0.18, 1.0, 0.85, 0.16), (0.3, 1.02, 0.87, 0.16), (0.55, 0.9, 0.78, 0.12),
                               (0.8, 0.66, 0.56, 0.06), (1.01, 0.1, 0.1, -0.1))]  # fmt: skip
    return body(keys, 2.2, stations=10, sides=16)


def _roof(p: MulticopterParameters) -> Mesh | None:
    size, top = p.roof_size, hull_top(p)
    if p.roof == "lidar":
        base, drum = top + 0.9 * size, 0.55 * size
        posts = [tube((x, y, 0.5 * top), (x, y, base), 0.009, sides=6)
                 for x in (-0.3 * size, 0.3 * size) for y in (-0.3 * size, 0.3 * size)]  # fmt: skip
        deck = tube((0.0, 0.0, base), (0.0, 0.0, base + 0.02), 1.2 * drum, sides=16)
        waist = tube((0.0, 0.0, base + 0.01), (0.0, 0.0, base + 1.2 * size), 0.85 * drum, sides=16)
        cap = tube((0.0, 0.0, base + 0.7 * size), (0.0, 0.0, base + 1.25 * size), drum, sides=16)
        return merge(*posts, deck, waist, cap)
    if p.roof == "parachute":
        x = -0.1 * p.hull_length
        can = tube((x, 0.0, 0.0), (x, 0.0, top + size), 0.34 * size, sides=16)
        lid = moved(ellipsoid((0.0, 0.0, 0.0), (0.2 * size, 0.34 * size, 0.34 * size), 7, 14), (x, 0.0, top + size),
                    rotation_about((0.0, 1.0, 0.0), 90.0))  # fmt: skip
        band = tube((x, 0.0, top + 0.55 * size), (x, 0.0, top + 0.68 * size), 0.38 * size, sides=16)
        return merge(can, lid, band)
    if p.roof == "camera":
        back = rotation_about((0.0, 1.0, 0.0), -25.0)
        case = merge(box((0.0, 0.0, 0.0), (0.5 * size, size, 0.75 * size)),
                     tube((0.2 * size, 0.18 * size, 0.08 * size), (0.42 * size, 0.18 * size, 0.08 * size), 0.22 * size),
                     box((-0.1 * size, 0.0, -0.5 * size), (0.3 * size, 0.7 * size, 0.6 * size)))  # fmt: skip
        return moved(case, (0.36 * p.hull_length, 0.0, top + 0.45 * size), back)
    return None


def _spray_boom(p: MulticopterParameters) -> Mesh:
    """A pipe across the flight direction under the payload, hung from the hull, with nozzles."""
    half, low, x = p.boom_span / 2, hull_under(p) - 0.55 * p.payload_size, -0.12
    pipe = tube((x, -half, low), (x, half, low), 0.013, sides=8)
    hangers = [tube((x, y, low), (0.0, 0.6 * y, 0.0), 0.01, sides=6) for y in (-0.14, 0.14)]
    nozzles = [tube((x, float(y), low + 0.01), (x, float(y), low - 0.06), 0.012, 0.026, sides=8)
               for y in np.linspace(-half, half, 6)]  # fmt: skip
    return merge(pipe, *hangers, *nozzles)


def _tail(p: MulticopterParameters) -> Mesh | None:
    """Fins at the rear of a fuselage, without any wing."""
    size, x, z = p.tail_size, -0.34 * p.hull_length, 0.15 * p.hull_height
    if p.tail == "vee":
        return both_sides(
            trapezoid((x, 0.0, z), (x - 0.5 * size, 0.8 * size, z + 0.8 * size), 0.75 * size, 0.45 * size)
        )
    if p.tail == "fin":
        return trapezoid((x, 0.0, z), (x - 0.5 * size, 0.0, z + size), 0.8 * size, 0.45 * size, 0.12, 0.0)
    return None
