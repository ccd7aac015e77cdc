"""Birds: skinned bodies, cambered wings of arm and hand, and tails; lengths are fractions of the wing span.

Proportions follow field guides: length over span 0.35 (albatross), 0.42 (gull), 0.5 (pigeon, crow), 0.62 (passerine);
aspect ratio (span squared over wing area) 4.5 to 15; the hand is 0.4-0.6 of the half span, more in swifts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from aerojax.simulate.assets.authoring import Part
from aerojax.simulate.assets.bird_families import FAMILIES
from aerojax.simulate.assets.bird_flight import JOINTS, WingBeat, fly
from aerojax.simulate.assets.lofts import Key, Sections, body, surface
from aerojax.simulate.assets.shapes import (
    Mesh,
    Vector,
    both_sides,
    merge,
    mirrored,
    moved,
    polyline_tube,
    rotation_about,
)
from aerojax.simulate.assets.skeletons import Skeleton, SkinnedAsset, SkinnedPart, rescaled
from aerojax.simulate.assets.variation import draw

UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class BirdParameters:
    """Shape and wing beat of a bird; lengths over the wing span, angles in degrees (see `WingBeat`).

    hand: share of the half span beyond the wrist. wrist_forward: of the wrist before the shoulder. tip_sweep: of the
    tip behind the wrist. fingers: separated primaries at the tip, if it is slotted. wing_place: share of the body
    length, from its front, of the wing's quarter chord. leg_drop: of the legs below the tail. body_pitch: of the trunk
    against the wings, nose up (slow flight).
    """

    body_length: float
    body_width: float
    body_depth: float
    neck_length: float
    neck_radius: float
    neck_rise: float
    head_radius: float
    bill_length: float
    bill_radius: float
    tail: str
    tail_length: float
    tail_width: float
    legs: float
    leg_drop: float
    body_pitch: float
    aspect: float
    hand: float
    wrist_forward: float
    tip_sweep: float
    tip: str
    fingers: int
    arch: float
    wing_place: float
    hertz: float
    rise: float
    fall: float
    downstroke: float
    fold: float
    lag: float
    heave: float
    beats: int
    glide_seconds: float
    glide_angle: float
    bounding: bool


def draw_parameters(family: str, rng: np.random.Generator) -> BirdParameters:
    """Draw one bird of a family."""
    return draw(BirdParameters, FAMILIES[family], rng)


def author(p: BirdParameters) -> SkinnedAsset:
    """Build the skinned parts, the skeleton and the wing beat; the span at rest, wings level, is 1 m."""
    wing = _wing(p)
    left = _wing_weights(p, wing, "left")
    level = body(_trunk_keys(p), 2.1, 2.0, 26, 14)
    turn = _pitch(p)
    trunk, bill, tail = (moved(mesh, (0.0, 0.0, 0.0), turn) for mesh in (level, _bill(p), _tail(p)))
    parts = [
        SkinnedPart(Part("trunk", trunk, 0), _trunk_weights(p, level)),
        SkinnedPart(Part("bill", bill, 1), _rigid(bill, "body/head")),
        SkinnedPart(Part("tail", tail, 0), _rigid(tail, "body/tail")),
        SkinnedPart(Part("wing_left", wing, 0), left),
        SkinnedPart(Part("wing_right", mirrored(wing), 0), left[:, [0, 1, 2, 5, 6, 3, 4]]),
    ]
    if p.legs > 0:
        legs = moved(_legs(p), (0.0, 0.0, 0.0), turn)
        parts.append(SkinnedPart(Part("legs", legs, 2), _rigid(legs, "body/tail")))
    skeleton = _skeleton(p)
    asset = SkinnedAsset(tuple(parts), skeleton, fly(_beat(p), skeleton))
    return rescaled(asset, 0.5 / float(wing.points[:, 1].max()))


def _beat(p: BirdParameters) -> WingBeat:
    return WingBeat(**{name: getattr(p, name) for name in WingBeat.__dataclass_fields__})


def _front(p: BirdParameters) -> float:
    """x of the breast; the origin lies under the wing's mean quarter chord."""
    return p.wing_place * p.body_length


def _trunk_keys(p: BirdParameters) -> list[Key]:
    """From the rump to the face: body, neck and head in one skin."""
    w, h, length, front = p.body_width / 2, p.body_depth / 2, p.body_length, _front(p)
    neck_end, head = front + p.neck_length, p.head_radius
    z_head = p.neck_rise
    return [
        (front - 1.08 * length, 0.12 * w, 0.1 * h, 0.15 * h),
        (front - 0.85 * length, 0.6 * w, 0.5 * h, 0.05 * h),
        (front - 0.45 * length, w, h, -0.12 * h),
        (front - 0.16 * length, 0.86 * w, 0.9 * h, -0.08 * h),
        (
            front + 0.06 * p.neck_length,
            max(p.neck_radius * 1.35, 0.5 * w),
            max(p.neck_radius * 1.35, 0.55 * h),
            0.3 * z_head,
        ),
        (front + 0.6 * p.neck_length, p.neck_radius, p.neck_radius, 0.75 * z_head),
        (neck_end + 0.25 * head, 0.9 * head, 0.95 * head, z_head),
        (neck_end + 0.9 * head, head, head, z_head),
        (neck_end + 1.6 * head, 0.78 * head, 0.75 * head, z_head),
        (neck_end + 2.05 * head, 0.2 * head, 0.2 * head, z_head - 0.1 * head),
    ]


def _bill(p: BirdParameters) -> Mesh:
    x = _front(p) + p.neck_length + 1.6 * p.head_radius
    z, r = p.neck_rise - 0.08 * p.head_radius, p.bill_radius
    keys = [
        (x, 0.8 * r, r, z),
        (x + 0.5 * p.bill_length, 0.5 * r, 0.7 * r, z),
        (x + p.bill_length, 0.1 * r, 0.12 * r, z - 0.3 * r),
    ]
    return body(keys, 2.0, 1.0, 7, 8)


def _tail(p: BirdParameters) -> Mesh:
    """A thin fan, wedge, square, pointed or forked tail from the rump."""
    root = _front(p) - 0.88 * p.body_length
    n, w, thin = p.tail_length, p.tail_width / 2, 0.004
    base = 0.3 * p.body_width
    if p.tail == "fork":
        lobe = [(0.0, 0.7 * base, 0.008, 0.0), (-0.5 * n, 0.3 * w, thin, 0.0), (-n, 0.04 * w, 0.5 * thin, 0.0)]
        spread = float(np.degrees(np.arctan2(0.75 * w, n)))
        one = moved(body(lobe, 2.5, 1.0, 10, 10), (root, 0.2 * base, 0.0), rotation_about((0.0, 0.0, 1.0), -spread))
        return both_sides(one)
    outline = {
        "fan": [(0.55, 0.72), (0.85, 1.0), (0.96, 0.8), (1.0, 0.35)],
        "wedge": [(0.5, 0.75), (0.7, 1.0), (0.85, 0.6), (1.0, 0.12)],
        "square": [(0.5, 0.75), (0.9, 1.0), (0.97, 0.97), (1.0, 0.85)],
        "pointed": [(0.25, 0.9), (0.5, 0.8), (0.75, 0.4), (1.0, 0.06)],
    }[p.tail]
    keys = [(root, base, 0.012, 0.0)] + [(root - a * n, b * w, thin * (1.2 - 0.8 * a), 0.0) for a, b in outline]
    return body(keys, 2.5, 1.0, 18, 12)


def _pitch(p: BirdParameters) -> Float[np.ndarray, "3 3"]:
    return rotation_about((0.0, 1.0, 0.0), -p.body_pitch)


def _legs(p: BirdParameters) -> Mesh:
    """Legs trailed under the tail or let down, with feet."""
    x, z = _front(p) - 0.7 * p.body_length, -0.25 * p.body_depth
    drop = np.deg2rad(p.leg_drop)
    foot: Vector = (x - p.legs * float(np.cos(drop)), 0.014, z - p.legs * float(np.sin(drop)))
    chain = [(x, 0.02, z), foot, (foot[0] - 0.03 * float(np.cos(drop)), 0.018, foot[2] - 0.012)]
    return both_sides(polyline_tube(chain, 0.006, 6))


def _slots(p: BirdParameters) -> bool:
    return p.tip == "slotted" and p.fingers > 0


def _planform(
    p: BirdParameters, share: Float[np.ndarray, "n"]
) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n"]]:
    """Leading edge and chord of the left wing, before the separated primaries, at shares of the half span."""
    wrist = 1 - p.hand
    outer = np.clip((share - wrist) / p.hand, 0, 1)
    inner = np.clip(share / wrist, 0, 1)
    if p.tip == "pointed":
        width = (1 - 0.1 * inner) * (1 - 0.93 * outer**1.35)
        recede = p.tip_sweep * outer**1.4
    elif not _slots(p):
        width = (1 - 0.04 * inner) * np.sqrt(np.clip(1 - outer**2.6, 0.012, 1))
        recede = p.tip_sweep * outer**2 + 0.22 / p.aspect * outer**4
    else:
        width = (1 + 0.06 * inner) * (1 - 0.28 * outer**2)
        recede = p.tip_sweep * outer**2
    dense = np.linspace(0, 1, 64)
    mean = float(np.interp(dense, share, width).mean()) if len(share) > 2 else 1.0
    chord = width / (p.aspect * mean)
    x = 0.3 / p.aspect + p.wrist_forward * np.sin(0.5 * np.pi * inner) - recede
    z = p.arch * np.sin(np.pi * share) + 0.22 * p.body_depth
    return np.stack([x, 0.5 * share, z], axis=1), chord


def _wing(p: BirdParameters) -> Mesh:
    reach = 0.8 if _slots(p) else 1.0
    share = np.concatenate(
        [
            np.linspace(0.04, 1 - p.hand, 7),
            1 - p.hand + p.hand * np.array([0.15, 0.3, 0.45, 0.6, 0.74, 0.86, 0.94, 1.0]),
        ]
    )
    edge, chord = _planform(p, share)
    keep = share <= max(reach, 1 - p.hand) + 1e-9
    edge, chord, kept = edge[keep], chord[keep], share[keep]
    # Thickness of arm and coverts fades to single feathers at the tip.
    thickness = np.interp(kept, [0.0, 1 - p.hand, 1.0], [0.1, 0.07, 0.05])
    camber = 0.07
    wing = surface(Sections(edge, chord, UP, thickness, camber, 3.0), points=5)
    return wing if not _slots(p) else merge(wing, *_fingers(p, edge[-1], float(chord[-1])))


def _fingers(p: BirdParameters, corner: Float[np.ndarray, "3"], chord: float) -> list[Mesh]:
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


def _skeleton(p: BirdParameters) -> Skeleton:
    edge, chord = _planform(p, np.array([0.0, _shoulder(p), 1 - p.hand, 1.0]))
    shoulder = edge[1] - np.array([0.25 * chord[1], 0.0, 0.0])
    wrist = edge[2] - np.array([0.15 * chord[2], 0.0, 0.0])
    flip = np.array([1.0, -1.0, 1.0])
    head = _pitch(p) @ np.array([_front(p), 0.0, 0.2 * p.neck_rise])
    tail = _pitch(p) @ np.array([_front(p) - 0.88 * p.body_length, 0.0, 0.0])
    return Skeleton(JOINTS, np.stack([np.zeros(3), head, tail, shoulder, wrist, flip * shoulder, flip * wrist]))


def _shoulder(p: BirdParameters) -> float:
    """Where the arm leaves the body, as a share of the half span."""
    return 0.7 * p.body_width


def _step(x: Float[np.ndarray, "n"], low: float, high: float) -> Float[np.ndarray, "n"]:
    t = np.clip((x - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)


def _wing_weights(p: BirdParameters, wing: Mesh, side: str) -> Float[np.ndarray, "vertex joint"]:
    share, root, wrist = wing.points[:, 1] / 0.5, _shoulder(p), 1 - p.hand
    free = _step(share, 0.4 * root, root + 0.07)
    hand = _step(share, wrist - 0.08, wrist + 0.08)
    weights = np.zeros((len(share), len(JOINTS)))
    weights[:, 0] = 1 - free
    weights[:, JOINTS.index(f"body/arm_{side}")] = free * (1 - hand)
    weights[:, JOINTS.index(f"body/arm_{side}/hand_{side}")] = free * hand
    return weights


def _trunk_weights(p: BirdParameters, trunk: Mesh) -> Float[np.ndarray, "vertex joint"]:
    x, front = trunk.points[:, 0], _front(p)
    head = _step(x, front - 0.1 * p.body_length, front + p.neck_length)
    tail = _step(-x, 0.65 * p.body_length - front, 1.0 * p.body_length - front)
    weights = np.zeros((len(x), len(JOINTS)))
    weights[:, 1], weights[:, 2] = head, tail
    weights[:, 0] = 1 - head - tail
    return weights


def _rigid(mesh: Mesh, joint: str) -> Float[np.ndarray, "vertex joint"]:
    return np.tile(np.eye(len(JOINTS))[JOINTS.index(joint)], (len(mesh.points), 1))
