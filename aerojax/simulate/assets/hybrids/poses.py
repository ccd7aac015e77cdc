"""Birds that hold still: gliding, with wings half or wholly folded, and perched."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from jaxtyping import Float

from aerojax.simulate.assets.birds.shape import BirdShape
from aerojax.simulate.assets.birds.wingbeat import JOINTS
from aerojax.simulate.assets.mesh.shapes import rotation_about
from aerojax.simulate.usd.skeletons import Motion

Pose = Literal["beating", "gliding", "half_folded", "folded", "perched"]
POSES: dict[Pose, float] = {"beating": 0.66, "gliding": 0.14, "half_folded": 0.1, "folded": 0.05, "perched": 0.05}
"""How often birds of the mixture are seen so."""


@dataclass(frozen=True)
class HeldWings:
    """Angles of held wings in degrees.

    raised: of the arm above level. swept: of the arm backwards. rolled: leading edge down about the span.
    folded: of the hand backwards at the wrist. drooped: of the hand below the arm.
    """

    raised: float
    swept: float
    rolled: float
    folded: float
    drooped: float


_RANGES: dict[Pose, tuple[tuple[float, float], ...]] = {
    "gliding": ((-8.0, 22.0), (-6.0, 14.0), (-4.0, 4.0), (0.0, 35.0), (-8.0, 10.0)),
    "half_folded": ((-6.0, 24.0), (-30.0, 30.0), (-4.0, 8.0), (40.0, 95.0), (-5.0, 15.0)),
    "folded": ((-6.0, 4.0), (74.0, 84.0), (14.0, 26.0), (0.0, 12.0), (-3.0, 3.0)),
    "perched": ((-12.0, -2.0), (74.0, 84.0), (16.0, 30.0), (0.0, 12.0), (-3.0, 3.0)),
}
"""Ranges of `HeldWings`, in its order. A half-folded arm may reach forward, as in a stoop, while the hand points back;
folded wings lie along the body as the tucked ones of bounding flight do."""


def draw_pose(rng: np.random.Generator) -> Pose:
    """Draw how a bird is seen."""
    return list(POSES)[int(rng.choice(len(POSES), p=list(POSES.values())))]


def draw_wings(pose: Pose, rng: np.random.Generator) -> HeldWings:
    """Draw the angles of wings that are not beating."""
    return HeldWings(*(float(rng.uniform(*limits)) for limits in _RANGES[pose]))


NARROWER: dict[Pose, float] = {"beating": 1.0, "gliding": 1.0, "half_folded": 1.15, "folded": 1.7, "perched": 1.8}
"""Aspect ratio of the wings over that of spread ones: the feathers of a closing wing slide over each other."""


def closed(p: BirdShape, pose: Pose, rng: np.random.Generator) -> BirdShape:
    """The shape of a bird in a pose: narrower wings; sitting, an upright trunk, legs let down and a closed tail."""
    p = replace(p, aspect=NARROWER[pose] * p.aspect)
    if pose != "perched":
        return p
    pitch = float(rng.uniform(20.0, 60.0))
    return replace(
        p,
        body_pitch=pitch,
        legs=max(p.legs, float(rng.uniform(0.08, 0.16))),
        leg_drop=float(np.clip(90.0 - pitch + rng.uniform(-8.0, 8.0), 20.0, 90.0)),
        tail_width=0.6 * p.tail_width,
    )


def held(wings: HeldWings, head_pitch: float, lean: float = 0.0) -> Motion:
    """A cycle of one second in which nothing moves.

    Args:
        wings: angles.
        head_pitch: degrees, nose down, of the head against the trunk.
        lean: degrees, nose up, that the folded wings take on from the trunk.
    """
    quaternion = np.zeros((2, len(JOINTS), 4))
    quaternion[..., 0] = 1.0
    quaternion[:, 1] = _quaternion(rotation_about((0.0, 1.0, 0.0), head_pitch))
    for side, joint in ((1.0, 3), (-1.0, 5)):
        arm = rotation_about((1.0, 0.0, 0.0), side * wings.raised) @ rotation_about((0.0, 0.0, 1.0), side * wings.swept)
        arm = rotation_about((0.0, 1.0, 0.0), -lean) @ arm @ rotation_about((0.0, 1.0, 0.0), wings.rolled)
        hand = rotation_about((1.0, 0.0, 0.0), -side * wings.drooped)
        quaternion[:, joint] = _quaternion(arm)
        quaternion[:, joint + 1] = _quaternion(hand @ rotation_about((0.0, 0.0, 1.0), side * wings.folded))
    return Motion(np.array([0.0, 1.0]), quaternion, np.zeros((2, len(JOINTS), 3)))


def _quaternion(rotation: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "4"]:
    """Unit quaternion (w, x, y, z) of a rotation of less than half a turn."""
    w = np.sqrt(max(1.0 + np.trace(rotation), 1e-12)) / 2
    off = rotation - rotation.T
    q = np.array([w, off[2, 1] / (4 * w), off[0, 2] / (4 * w), off[1, 0] / (4 * w)])
    return q / np.linalg.norm(q)
