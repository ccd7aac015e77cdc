"""Procedural identities as animated meshes in memory: what their USD files hold, without a file or a texture."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from aerojax.simulate.assets.catalogue import Identity, asset_of, colour_seed_of
from aerojax.simulate.assets.mesh.parts import Part
from aerojax.simulate.assets.mesh.shapes import frame_along, rotation_about
from aerojax.simulate.assets.paint.face_colours import face_colours
from aerojax.simulate.usd.animated_mesh import AnimatedMesh
from aerojax.simulate.usd.authoring import Asset, whole_turns
from aerojax.simulate.usd.joints import EvaluateJoints
from aerojax.simulate.usd.skeletons import SkinnedAsset, strongest
from aerojax.simulate.usd.skinning import Evaluate


def build_animated(identity: Identity) -> AnimatedMesh:
    """The animated mesh of a procedural identity: faces, vertices and joints as those of its USD file.

    Every face has one colour, the mean of what the file's texture shows on it.

    Raises:
        UserError: if the identity names an unknown class or family.
    """
    return animated_asset(asset_of(identity), identity.name, colour_seed_of(identity))


def animated_asset(asset: Asset | SkinnedAsset, name: str, colour_seed: int) -> AnimatedMesh:
    """The animated mesh of an asset of this name, painted from a seed."""
    root = "/" + re.sub(r"\W", "_", name)
    if isinstance(asset, SkinnedAsset):
        parts = tuple(skinned.part for skinned in asset.parts)
        names = tuple(f"{root}/skin/{part.name}" for part in parts)
        evaluate, joints = _skinned(asset)
        return _mesh(parts, names, colour_seed, float(asset.motion.seconds[-1]), (evaluate,), joints)
    names = tuple(f"{root}/{p.name}" + ("" if p.spin is None else "/mesh") for p in asset.parts)
    evaluate_each = tuple(_rigid(part, asset.cycle_seconds) for part in asset.parts)
    return _mesh(asset.parts, names, colour_seed, asset.cycle_seconds, evaluate_each, _rotors(asset))


def _mesh(
    parts: tuple[Part, ...],
    names: tuple[str, ...],
    colour_seed: int,
    cycle_seconds: float,
    evaluate: tuple[Evaluate, ...],
    joints: EvaluateJoints,
) -> AnimatedMesh:
    offsets = np.cumsum([0] + [len(part.mesh.points) for part in parts[:-1]])
    counts = [len(part.mesh.faces) for part in parts]
    total = sum(counts)
    return AnimatedMesh(
        faces=np.concatenate([p.mesh.faces + o for p, o in zip(parts, offsets, strict=True)]).astype(np.int32),
        albedo=face_colours(parts, colour_seed).astype(np.float32),
        uv=np.zeros((total, 3, 2), np.float32),
        texture=np.full(total, -1, np.int32),
        textures=(),
        part=np.repeat(np.arange(len(parts), dtype=np.uint16), counts),
        part_names=names,
        cycle_seconds=cycle_seconds,
        _stage=None,
        _evaluate=evaluate,
        _joints=(joints,),
        _time_codes_per_second=1.0,  # evaluators take seconds
        _first_time_code=0.0,
    )


def _pose(part: Part, cycle_seconds: float) -> Callable[[float], Float[np.ndarray, "4 4"]]:
    """`body_from_part` of a spinning part at a time in seconds."""
    spin = part.spin
    assert spin is not None
    basis, turns = frame_along(np.asarray(spin.axis, float)), whole_turns(spin, cycle_seconds)

    def at(seconds: float) -> Float[np.ndarray, "4 4"]:
        pose = np.eye(4)
        angle = spin.phase_degrees + 360.0 * turns * seconds / cycle_seconds
        pose[:3, :3] = basis @ rotation_about((0.0, 0.0, 1.0), angle)
        pose[:3, 3] = spin.hub
        return pose

    return at


def _rigid(part: Part, cycle_seconds: float) -> Evaluate:
    points = part.mesh.points.astype(np.float32)
    if part.spin is None:
        return lambda seconds: points
    pose = _pose(part, cycle_seconds)

    def at(seconds: float) -> Float[np.ndarray, "vertex 3"]:
        matrix = pose(seconds)
        return (points @ matrix[:3, :3].T + matrix[:3, 3]).astype(np.float32)

    return at


def _rotors(asset: Asset) -> EvaluateJoints:
    poses = {part.name: _pose(part, asset.cycle_seconds) for part in asset.parts if part.spin is not None}
    return lambda seconds: {name: pose(seconds) for name, pose in poses.items()}


def _skinned(asset: SkinnedAsset) -> tuple[Evaluate, EvaluateJoints]:
    """Linear-blend skinning as UsdSkel does it: joints interpolate spherically, weights are the strongest three."""
    points = np.concatenate([s.part.mesh.points for s in asset.parts]).astype(np.float32)
    indices, share = strongest(np.concatenate([s.weights for s in asset.parts]))
    weights = np.zeros((len(points), len(asset.skeleton.paths)))
    np.put_along_axis(weights, indices, share, axis=1)
    homogeneous = np.concatenate([points, np.ones((len(points), 1))], axis=1)

    def vertices(seconds: float) -> Float[np.ndarray, "vertex 3"]:
        moved = _joint_poses(asset, seconds)
        moved[:, :3, 3] -= np.einsum("jrc,jc->jr", moved[:, :3, :3], asset.skeleton.pivots)
        blended = np.einsum("vj,jrc->vrc", weights, moved[:, :3])
        return np.einsum("vrc,vc->vr", blended, homogeneous).astype(np.float32)

    return vertices, lambda seconds: dict(zip(asset.skeleton.paths, _joint_poses(asset, seconds), strict=True))


def _joint_poses(asset: SkinnedAsset, seconds: float) -> Float[np.ndarray, "joint 4 4"]:
    """`body_from_joint` of every joint at a time in seconds."""
    skeleton, motion = asset.skeleton, asset.motion
    index = min(max(int(np.searchsorted(motion.seconds, seconds, side="right")) - 1, 0), len(motion.seconds) - 2)
    step = motion.seconds[index + 1] - motion.seconds[index]
    t = float(np.clip((seconds - motion.seconds[index]) / step, 0.0, 1.0))
    quaternion = _slerp(motion.quaternion[index], motion.quaternion[index + 1], t)
    shift = (1 - t) * motion.shift[index] + t * motion.shift[index + 1]
    poses = np.tile(np.eye(4), (len(skeleton.paths), 1, 1))
    poses[:, :3, :3] = _rotation(quaternion)
    for joint in range(len(poses)):
        parent = skeleton.parent(joint)
        origin = skeleton.pivots[parent] if parent >= 0 else np.zeros(3)
        poses[joint, :3, 3] = skeleton.pivots[joint] - origin + shift[joint]
        if parent >= 0:
            poses[joint] = poses[parent] @ poses[joint]
    return poses


def _slerp(a: Float[np.ndarray, "joint 4"], b: Float[np.ndarray, "joint 4"], t: float) -> Float[np.ndarray, "joint 4"]:
    """Spherical interpolation of unit quaternions along the shorter arc (Shoemake 1985)."""
    cosine = np.einsum("jc,jc->j", a, b)[:, None]
    b, cosine = np.where(cosine < 0, -b, b), np.abs(cosine).clip(max=1.0)
    angle = np.arccos(cosine)
    sine = np.sin(angle).clip(1e-12)
    near = angle < 1e-5
    mixed = np.where(near, (1 - t) * a + t * b, (np.sin((1 - t) * angle) * a + np.sin(t * angle) * b) / sine)
    return mixed / np.linalg.norm(mixed, axis=1, keepdims=True)


def _rotation(q: Float[np.ndarray, "joint 4"]) -> Float[np.ndarray, "joint 3 3"]:
    w, x, y, z = q.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)
