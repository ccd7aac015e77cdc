"""Linear-blend skinning of one part, written a second time for the tests."""

from __future__ import annotations

import numpy as np

from aerojax.simulate.usd.skeletons import SkinnedAsset


def matrix_of(quaternion: np.ndarray) -> np.ndarray:
    """Rotation of a unit quaternion w, x, y, z."""
    w, x, y, z = quaternion
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + 2 * w * cross + 2 * cross @ cross


def posed(asset: SkinnedAsset, sample: int, name: str) -> np.ndarray:
    """Linear-blend skinning of one part at one sample of the motion."""
    bones, motion = asset.skeleton, asset.motion
    turn, place = [], []
    for joint, pivot in enumerate(bones.pivots):
        own, parent = matrix_of(motion.quaternion[sample, joint]), bones.parent(joint)
        offset = pivot + motion.shift[sample, joint] - (bones.pivots[parent] if parent >= 0 else 0.0)
        turn.append(own if parent < 0 else turn[parent] @ own)
        place.append(offset if parent < 0 else place[parent] + turn[parent] @ offset)
    part = next(p for p in asset.parts if p.part.name == name)
    local = part.part.mesh.points[:, None] - bones.pivots
    return np.einsum("vj,jab,vjb->va", part.weights, np.stack(turn), local) + part.weights @ np.stack(place)
