"""Birds: skinned bodies, cambered wings of arm and hand, and tails, put together and set in motion."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from aerojax.simulate.assets.birds import bodies, wings
from aerojax.simulate.assets.birds.families import BirdParameters
from aerojax.simulate.assets.birds.shape import BirdShape
from aerojax.simulate.assets.birds.wingbeat import JOINTS, fly
from aerojax.simulate.assets.mesh.shapes import Mesh, mirrored, moved, rotation_about
from aerojax.simulate.usd.authoring import Part
from aerojax.simulate.usd.skeletons import Skeleton, SkinnedAsset, SkinnedPart, rescaled

LEVEL_HEAD = 0.8
"""Share of the trunk's pitch that the neck takes back, so that the gaze stays near the horizon."""


def build_bird(parameters: BirdParameters) -> SkinnedAsset:
    """Build the skinned parts, the skeleton and the wing beat; the span at rest, wings level, is 1 m."""
    p = parameters.shape
    wing = wings.wing(p)
    left = _wing_weights(p, wing, "left")
    level = bodies.trunk(p)
    parts = [
        SkinnedPart(Part("trunk", moved(level, (0.0, 0.0, 0.0), _pitch(p)), 0), _trunk_weights(p, level)),
        SkinnedPart(Part("wing_left", wing, 0), left),
        SkinnedPart(Part("wing_right", mirrored(wing), 0), left[:, [0, 1, 2, 5, 6, 3, 4]]),
    ]
    parts += _appendages(p)
    asset = SkinnedAsset(tuple(parts), _skeleton(p), fly(parameters.beat, LEVEL_HEAD * p.body_pitch))
    return rescaled(asset, 0.5 / float(wing.points[:, 1].max()))


def _appendages(p: BirdShape) -> list[SkinnedPart]:
    """What moves rigidly with the head or the tail."""
    built = [
        ("bill", bodies.bill(p), 1, "body/head"),
        ("eyes", bodies.eyes(p), 7, "body/head"),
        ("crest", bodies.crest(p), 5, "body/head"),
        ("tail", bodies.tail(p), 0, "body/tail"),
        ("legs", bodies.legs(p), 2, "body/tail"),
    ]
    parts = []
    for name, mesh, role, joint in built:
        if mesh is not None:
            turned = moved(mesh, (0.0, 0.0, 0.0), _pitch(p))
            parts.append(SkinnedPart(Part(name, turned, role), _rigid(turned, joint)))
    return parts


def _pitch(p: BirdShape) -> Float[np.ndarray, "3 3"]:
    return rotation_about((0.0, 1.0, 0.0), -p.body_pitch)


def _skeleton(p: BirdShape) -> Skeleton:
    edge, chord = wings.planform(p, np.array([p.shoulder, 1 - p.hand]))
    shoulder = edge[0] - np.array([0.25 * chord[0], 0.0, 0.0])
    wrist = edge[1] - np.array([0.15 * chord[1], 0.0, 0.0])
    flip = np.array([1.0, -1.0, 1.0])
    head = _pitch(p) @ np.array([p.front, 0.0, 0.2 * p.neck_rise])
    tail = _pitch(p) @ np.array([p.rump, 0.0, 0.0])
    return Skeleton(JOINTS, np.stack([np.zeros(3), head, tail, shoulder, wrist, flip * shoulder, flip * wrist]))


def _step(x: Float[np.ndarray, "n"], low: float, high: float) -> Float[np.ndarray, "n"]:
    t = np.clip((x - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)


def _wing_weights(p: BirdShape, wing: Mesh, side: str) -> Float[np.ndarray, "vertex joint"]:
    share, root, wrist = wing.points[:, 1] / 0.5, p.shoulder, 1 - p.hand
    free = _step(share, 0.4 * root, root + 0.07)
    hand = _step(share, wrist - 0.08, wrist + 0.08)
    weights = np.zeros((len(share), len(JOINTS)))
    weights[:, 0] = 1 - free
    weights[:, JOINTS.index(f"body/arm_{side}")] = free * (1 - hand)
    weights[:, JOINTS.index(f"body/arm_{side}/hand_{side}")] = free * hand
    return weights


def _trunk_weights(p: BirdShape, trunk: Mesh) -> Float[np.ndarray, "vertex joint"]:
    x, front = trunk.points[:, 0], p.front
    head = _step(x, front - 0.24 * p.body_length, front + p.neck_length)
    tail = _step(-x, 0.65 * p.body_length - front, 1.0 * p.body_length - front)
    weights = np.zeros((len(x), len(JOINTS)))
    weights[:, 1], weights[:, 2] = head, tail
    weights[:, 0] = 1 - head - tail
    return weights


def _rigid(mesh: Mesh, joint: str) -> Float[np.ndarray, "vertex joint"]:
    return np.tile(np.eye(len(JOINTS))[JOINTS.index(joint)], (len(mesh.points), 1))
