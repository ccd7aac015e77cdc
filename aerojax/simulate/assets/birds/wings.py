"""Wings of a bird: cambered arm and hand, round, pointed or slotted tips."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from aerojax.simulate.assets.birds.shape import BirdShape
from aerojax.simulate.assets.mesh.lofts import Sections, surface
from aerojax.simulate.assets.mesh.shapes import Mesh, merge

UP = np.array([0.0, 0.0, 1.0])


def _outline(p: BirdShape, share: Float[np.ndarray, "n"]) -> tuple[Float[np.ndarray, "n"], Float[np.ndarray, "n"]]:
    """Chord over its largest and how far the leading edge lies behind the wrist, at shares of the half span."""
    outer = np.clip((share - 1 + p.hand) / p.hand, 0, 1)
    inner = np.clip(share / (1 - p.hand), 0, 1)
    if p.tip == "pointed":
        return (1 - 0.1 * inner) * (1 - 0.93 * outer**1.35), p.tip_sweep * outer**1.4
    if p.slotted:
        return (1 + 0.06 * inner) * (1 - 0.28 * outer**2), p.tip_sweep * outer**2
    width = (1 - 0.04 * inner) * np.sqrt(np.clip(1 - outer**2.6, 0.012, 1))
    return width, p.tip_sweep * outer**2 + 0.22 / p.aspect * outer**4


def planform(p: BirdShape, share: Float[np.ndarray, "n"]) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n"]]:
    """Leading edge and chord of the left wing, before the separated primaries, at shares of the half span."""
    width, recede = _outline(p, share)
    mean = float(_outline(p, np.linspace(0, 1, 64))[0].mean())
    inner = np.clip(share / (1 - p.hand), 0, 1)
    x = 0.3 / p.aspect + p.wrist_forward * np.sin(0.5 * np.pi * inner) - recede
    z = p.arch * np.sin(np.pi * share) + 0.22 * p.body_depth
    return np.stack([x, 0.5 * share, z], axis=1), width / (p.aspect * mean)


def _feathers(p: BirdShape) -> tuple[Float[np.ndarray, "n"], Float[np.ndarray, "n"]]:
    """Sections at shares of the half span, three a flight feather, and how much of the chord each keeps.

    Where two feathers meet the trailing edge is notched by a twentieth of the chord.
    """
    wrist, end = 1 - p.hand, 0.8 if p.slotted else 1.0
    arm = np.linspace(0.04, wrist, 8)
    hand = wrist + (end - wrist) * (1 - (1 - np.linspace(0, 1, 11)) ** 1.4)
    bound = np.concatenate([arm, hand[1:]])
    share = bound[:-1, None] + np.diff(bound)[:, None] * np.array([0.0, 0.3, 0.75])
    keep = np.tile([0.95, 1.0, 1.0], (len(bound) - 1, 1))
    return np.append(share, end), np.append(keep, 0.95)


def wing(p: BirdShape) -> Mesh:
    """The left wing, level, from inside the body to the tip."""
    share, keep = _feathers(p)
    edge, chord = planform(p, share)
    # Thickness of arm and coverts fades to single feathers at the tip.
    thickness = np.interp(share, [0.0, 1 - p.hand, 1.0], [0.1, 0.07, 0.05])
    sheet = surface(Sections(edge, chord * keep, UP, thickness, 0.07, 3.0), points=5)
    return merge(sheet, *_fingers(p, edge[-1], float(chord[-1]))) if p.slotted else sheet


def _fingers(p: BirdShape, corner: Float[np.ndarray, "3"], chord: float) -> list[Mesh]:
    """Separated primaries fanned over the end of the hand; the leading ones reach furthest."""
    count, feathers = p.fingers, []
    for i in range(count):
        across = (i + 0.5) / count
        heading = np.deg2rad(84.0 - 42.0 * p.tip_sweep - 36.0 * across)
        reach = (0.5 - corner[1]) * (1.0 if i in (1, 2) else 0.9) * (1.12 - 0.35 * across)
        direction = np.array([np.cos(heading) * (-1.0 if across > 0.3 else 0.0), np.sin(heading), 0.06])
        share = np.array([-0.25, 0.3, 0.8, 1.0])
        width = 1.12 * chord / count * np.array([1.0, 0.95, 0.7, 0.3])
        start = corner + np.array([-0.92 * chord * across + 0.3 * chord / count, 0.0, 0.01 * (1 - across)])
        edge = start + share[:, None] * reach * direction
        feathers.append(surface(Sections(edge, width, UP, np.full(4, 0.1), 0.03, 2.0), points=3))
    return feathers
