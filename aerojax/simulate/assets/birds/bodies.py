"""Trunk, head, bill, crest, tail and legs of a bird, level and before the trunk's pitch."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from aerojax.simulate.assets.birds.shape import BirdShape
from aerojax.simulate.assets.mesh.lofts import Key, body, fan
from aerojax.simulate.assets.mesh.shapes import (
    Mesh,
    Vector,
    both_sides,
    ellipsoid,
    moved,
    polyline_tube,
    rotation_about,
)

BILLS: dict[str, list[tuple[float, float, float, float]]] = {
    "cone": [(0.0, 0.8, 1.0, 0.0), (0.5, 0.5, 0.7, 0.0), (1.0, 0.1, 0.12, 0.04)],
    "dagger": [(0.0, 0.8, 1.0, 0.0), (0.5, 0.55, 0.7, 0.0), (1.0, 0.07, 0.08, 0.0)],
    "hook": [(0.0, 0.8, 1.0, 0.0), (0.5, 0.75, 1.0, 0.06), (0.85, 0.45, 0.75, 0.35), (1.0, 0.1, 0.3, 0.75)],
    "curved": [(0.0, 0.9, 1.0, 0.0), (0.35, 0.7, 0.75, 0.03), (0.7, 0.45, 0.5, 0.15), (1.0, 0.1, 0.1, 0.34)],
    "flat": [(0.0, 0.9, 1.0, 0.0), (0.5, 1.1, 0.55, 0.08), (0.9, 1.3, 0.3, 0.12), (1.0, 0.7, 0.15, 0.12)],
    "pouch": [(0.0, 1.0, 1.3, 0.03), (0.3, 0.95, 1.9, 0.13), (0.7, 0.7, 1.1, 0.08), (1.0, 0.15, 0.2, 0.02)],
    "bent": [(0.0, 0.8, 1.0, 0.0), (0.45, 0.8, 1.0, 0.08), (0.7, 0.7, 0.9, 0.4), (1.0, 0.2, 0.3, 0.95)],
}
"""Sections of each kind of bill: share of its length, half width and half height over its radius, drop over its length:
seed eaters; herons and kingfishers; raptors and parrots; waders; ducks; pelicans; flamingos."""

TAILS: dict[str, Callable[[Float[np.ndarray, "n"]], Float[np.ndarray, "n"]]] = {
    "fan": lambda v: 1 - 0.12 * v**2 - 0.08 * v**10,
    "square": lambda v: 1 - 0.03 * v**8,
    "wedge": lambda v: 1 - 0.46 * v,
    "pointed": lambda v: 1 - 0.7 * v**0.8,
    "lance": lambda v: 1 - 0.8 * v**0.35,
    "notch": lambda v: 0.74 + 0.26 * v,
    "fork": lambda v: 0.45 + 0.55 * v**1.3,
    "streamers": lambda v: 0.36 + 0.12 * v + 0.52 * v**6,
}
"""Length of the feathers of each kind of tail, over the longest, from the middle (0) to the edge (1)."""


def trunk(p: BirdShape) -> Mesh:
    """Body, neck and head in one skin, from the rump to the face."""
    return body(_trunk_keys(p), 2.1, 2.0, 30, 16)


def _trunk_keys(p: BirdShape) -> list[Key]:
    w, h, length, front = p.body_width / 2, p.body_depth / 2, p.body_length, p.front
    neck_end, head, z_head, r = front + p.neck_length, p.head_radius, p.neck_rise, p.neck_radius
    base_width, base_depth, hang = (
        np.clip(1.35 * r, 0.5 * w, 0.88 * w),
        np.clip(1.35 * r, 0.55 * h, 0.88 * h),
        p.neck_fold * r,
    )
    return [
        (front - 1.08 * length, 0.12 * w, 0.1 * h, 0.15 * h),
        (front - 0.85 * length, 0.6 * w, 0.5 * h, 0.05 * h),
        (front - 0.45 * length, w, h, -0.12 * h),
        (front - 0.16 * length, 0.86 * w, 0.9 * h, -0.08 * h),
        (front + 0.06 * p.neck_length, base_width, base_depth + 0.4 * hang, 0.3 * z_head - 0.4 * hang),
        (front + 0.6 * p.neck_length, r, r + 0.6 * hang, 0.75 * z_head - 0.6 * hang),
        (neck_end + 0.25 * head, 0.9 * head, 0.95 * head, z_head),
        (neck_end + 0.9 * head, head, head, z_head),
        (neck_end + 1.6 * head, 0.78 * head, 0.75 * head, z_head),
        (neck_end + 2.05 * head, 0.2 * head, 0.2 * head, z_head - 0.1 * head),
    ]


def bill(p: BirdShape) -> Mesh:
    """The bill, rooted inside the face."""
    x = p.front + p.neck_length + 1.6 * p.head_radius
    z, r, n = p.neck_rise - 0.08 * p.head_radius, p.bill_radius, p.bill_length
    keys = [(x + t * n, wide * r, deep * r, z - drop * n) for t, wide, deep, drop in BILLS[p.bill]]
    return body(keys, 2.0, 1.0, 10, 8)


def eyes(p: BirdShape) -> Mesh:
    """Two eyes that stand out of the head by a third of their size."""
    head = p.head_radius
    x, size = p.front + p.neck_length + 1.25 * head, 0.2 * head
    return both_sides(ellipsoid((x, 0.84 * head, p.neck_rise + 0.22 * head), (size, size, size), 6, 8))


def crest(p: BirdShape) -> Mesh | None:
    """A raised fan of feathers over the crown, or None without a crest."""
    if p.crest == 0:
        return None
    angle = np.linspace(0.0, 80.0, 9)
    # Ragged like single feathers: every second one ends early.
    length = p.crest * (1 - 0.25 * (np.arange(9) % 2)) * np.interp(angle, [0, 40, 80], [0.9, 1.0, 0.7])
    flat = fan(angle, 0.3 * p.head_radius, 0.3 * p.head_radius + length, (0.12 * p.head_radius, 0.002))
    place = (p.front + p.neck_length + 1.0 * p.head_radius, 0.0, p.neck_rise + 0.75 * p.head_radius)
    return moved(flat, place, rotation_about((1.0, 0.0, 0.0), 90.0))


def tail(p: BirdShape) -> Mesh:
    """A thin fan of feathers from the rump, its end cut as `TAILS` says."""
    n = p.tail_length
    base = min(0.28 * p.body_width, 0.4 * p.tail_width)
    spread = np.arcsin(np.clip((p.tail_width / 2 - base) / n, 0.03, 0.95))
    across = np.linspace(-1.0, 1.0, 25)
    notch = 1 - 0.03 * (np.arange(25) % 2)  # every second section lies where two feathers meet
    hub = base / np.sin(spread)
    flat = fan(np.degrees(spread) * across, hub, hub + n * notch * TAILS[p.tail](np.abs(across)), (0.008, 0.002))
    return moved(flat, (p.rump + hub * float(np.cos(spread)), 0.0, 0.0))


def legs(p: BirdShape) -> Mesh | None:
    """Legs trailed under the tail or let down, with feet; None where they are tucked into the plumage."""
    if p.legs == 0:
        return None
    x, z = p.front - 0.7 * p.body_length, -0.25 * p.body_depth
    drop = np.deg2rad(p.leg_drop)
    foot: Vector = (x - p.legs * float(np.cos(drop)), 0.014, z - p.legs * float(np.sin(drop)))
    toe: Vector = (foot[0] - 0.035 * float(np.cos(drop)), 0.022, foot[2] - 0.012)
    return both_sides(polyline_tube([(x, 0.02, z), foot, toe], 0.006, 6))
