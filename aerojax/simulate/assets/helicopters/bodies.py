"""What surrounds a helicopter's cabin: glass, engine housing, landing gear, stub wings, sponsons and cargo."""

from __future__ import annotations

from aerojax.simulate.assets.helicopters.layout import HelicopterParameters, boom_height
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
    tube,
)


def glass(p: HelicopterParameters, cabin: list[Key]) -> Mesh:
    """Windscreen: the cabin's front, a little larger and higher, ahead of the doors; a bubble is all of the front."""
    nose, front, middle, *_ = cabin
    if p.bubble:
        keys = [(x, 1.025 * w, 1.025 * h, z) for x, w, h, z in (nose, front, middle)]
        start, end = (0.006, *keys[0][1:]), (middle[0] - 0.04, *keys[2][1:])
        return body([start, *keys[1:], end], p.cabin_exponent, stations=14)
    start = nose[0] + 0.3 * (front[0] - nose[0])
    end = middle[0] - 0.05
    keys = [
        (start, 0.3 * front[1], 0.25 * front[2], 0.7 * nose[3] + 0.15 * front[2]),
        (front[0], 0.93 * front[1], 0.75 * front[2], front[3] + 0.3 * front[2]),
        (0.5 * (front[0] + middle[0]), 1.02 * 0.5 * (front[1] + middle[1]), 0.6 * middle[2], 0.4 * middle[2]),
        (end, 1.01 * middle[1], 0.4 * middle[2], 0.42 * middle[2]),
    ]
    return body(keys, p.cabin_exponent, stations=10, sides=16)


def cowling(p: HelicopterParameters) -> Mesh:
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


def gear(p: HelicopterParameters) -> Mesh:
    """Skids, wheels on struts, or closed doors."""
    floor = -0.48 * p.cabin_height
    ground, half = floor - p.gear_height, p.gear_width / 2
    front, rear = -0.28 * p.cabin_length, -0.66 * p.cabin_length
    if p.gear == "skids":
        bows = [tube((x, 0.25 * p.cabin_width, floor + 0.03), (x, half, ground), 0.008, sides=6) for x in (front, rear)]
        skid = polyline_tube(
            [(front + 0.1, half, ground + 0.035), (front + 0.06, half, ground), (rear - 0.09, half, ground)], 0.009
        )
        return both_sides(merge(*bows, skid))
    if p.gear == "stilts":
        return _stilts(p, ground)
    if p.gear == "tucked":
        return box((0.5 * (front + rear), 0.0, floor), (0.5 * abs(front - rear), 0.5 * p.cabin_width, 0.02))
    radius = 0.024
    main = rear if p.layout != "tandem" else -0.25
    leg = tube((main, 0.4 * p.cabin_width, floor + 0.06), (main, half, ground + radius), 0.01, sides=6)
    wheel = tube((main, half - 0.012, ground + radius), (main, half + 0.012, ground + radius), radius, sides=12)
    tail_x = -0.8 if p.layout != "coaxial" else front + 0.08
    low = (
        floor + 0.06
        if p.layout == "coaxial"
        else boom_height(p, tail_x)
        if p.layout in ("single", "intermeshing")
        else floor + 0.04
    )
    strut = tube((tail_x, 0.0, low), (tail_x, 0.0, ground + radius), 0.008, sides=6)
    small = tube((tail_x, -0.01, ground + radius), (tail_x, 0.01, ground + radius), 0.8 * radius, sides=12)
    return merge(both_sides(merge(leg, wheel)), strut, small)


def _stilts(p: HelicopterParameters, ground: float) -> Mesh:
    """Two long legs from the spine with a wheel each, and a nose wheel: room for cargo between them."""
    x, half, radius = -p.mast_place - 0.06, p.gear_width / 2, 0.03
    hip = (x, 0.0, boom_height(p, x))
    leg = polyline_tube([hip, (x, half, hip[2] - 0.04), (x, half, ground + radius)], 0.013, sides=8)
    wheel = tube((x, half - 0.016, ground + radius), (x, half + 0.016, ground + radius), radius, sides=12)
    nose = -0.4 * p.cabin_length
    strut = tube((nose, 0.0, -0.3 * p.cabin_height), (nose, 0.0, ground + radius), 0.01, sides=6)
    small = tube((nose, -0.012, ground + radius), (nose, 0.012, ground + radius), 0.8 * radius, sides=12)
    return merge(both_sides(merge(leg, wheel)), strut, small)


def cargo(p: HelicopterParameters) -> Mesh:
    """A container under the spine, between the legs."""
    x, height = -p.mast_place - 0.05, 0.42 * p.cargo
    top = boom_height(p, x) - 0.01
    return box((x, 0.0, top - height / 2), (p.cargo, 0.5 * p.gear_width, height))


def stub_wings(p: HelicopterParameters) -> Mesh:
    """Short wings with pods, and a turret under the nose."""
    x, half, z = -p.mast_place, p.stub_wings / 2, -0.1 * p.cabin_height
    wing = trapezoid((x + 0.03, 0.0, z), (x, half, z - 0.02), 0.11, 0.08, 0.14, 0.02)
    pods = [_pod((x - 0.03, share * half, z - 0.045), 0.13, r) for share, r in ((0.68, 0.018), (0.95, 0.012))]
    chin = ellipsoid((-0.03, 0.0, -0.45 * p.cabin_height), (0.025, 0.02, 0.025), 6, 10)
    return merge(both_sides(merge(wing, *pods)), chin)


def _pod(centre: Vector, length: float, radius: float) -> Mesh:
    x, y, z = centre
    keys = [(length / 2, 0.1 * radius), (0.3 * length, radius), (-0.4 * length, radius), (-length / 2, 0.5 * radius)]
    return moved(body([(a, r, r, 0.0) for a, r in keys], stations=8, sides=8), (x, y, z))


def sponsons(p: HelicopterParameters) -> Mesh:
    """Fairings along both sides of the belly."""
    length = p.sponsons
    x, y, z = -0.45, 0.52 * p.cabin_width, -0.32 * p.cabin_height
    keys = [(length / 2, 0.006), (0.25 * length, 0.032), (-0.25 * length, 0.034), (-length / 2, 0.006)]
    one = body([(a, r, 1.1 * r, 0.0) for a, r in keys], 2.6, stations=10, sides=10)
    return both_sides(moved(one, (x, y, z)))
