"""Write skinned assets with UsdSkel: joints, linear-blend weights and time-sampled joint rotations."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel, Vt

from aerojax.simulate.assets.mesh.parts import Part
from aerojax.simulate.assets.mesh.shapes import scaled
from aerojax.simulate.assets.paint.materials import Materials, bake_texture
from aerojax.simulate.usd.authoring import TIME_CODES_PER_SECOND, write_mesh, write_stage

INFLUENCES = 3
"""Joints a vertex: a wing's root zone blends the body with the arm, its wrist the arm with the hand."""


@dataclass(frozen=True)
class Skeleton:
    """Joints of an asset.

    paths: joint names with their ancestors, parents first ("body/arm_left").
    pivots: position of each joint at rest, body frame, metres.
    """

    paths: tuple[str, ...]
    pivots: Float[np.ndarray, "joint 3"]

    def parent(self, joint: int) -> int:
        """Index of the parent joint, -1 for the root."""
        name = self.paths[joint].rpartition("/")[0]
        return self.paths.index(name) if name else -1


@dataclass(frozen=True)
class Motion:
    """One cycle of joint transforms relative to the parent joint's frame.

    seconds: sample times from 0 to the length of the cycle, whose last sample equals the first.
    quaternion: w, x, y, z.
    shift: added to the joint's rest position, metres.
    """

    seconds: Float[np.ndarray, "time"]
    quaternion: Float[np.ndarray, "time joint 4"]
    shift: Float[np.ndarray, "time joint 3"]


@dataclass(frozen=True)
class SkinnedPart:
    """A mesh and how much each joint moves each of its vertices (rows sum to 1)."""

    part: Part
    weights: Float[np.ndarray, "vertex joint"]


@dataclass(frozen=True)
class SkinnedAsset:
    """Skinned parts in their rest pose (body frame), the skeleton and one cycle of its motion."""

    parts: tuple[SkinnedPart, ...]
    skeleton: Skeleton
    motion: Motion


def write_skinned(path: Path, asset: SkinnedAsset, colour_seed: int) -> None:
    """Write a skinned asset under a SkelRoot whose extent follows the motion."""
    texture = bake_texture(path, tuple(skinned.part for skinned in asset.parts), colour_seed)

    def fill(stage: Usd.Stage, root: Sdf.Path) -> None:
        materials = Materials(stage, root.AppendChild("materials"), texture)
        holder = UsdSkel.Root.Define(stage, root.AppendChild("skin"))
        skeleton = _write_skeleton(stage, holder.GetPath().AppendChild("skeleton"), asset.skeleton)
        animation = _write_motion(stage, skeleton.GetPath().AppendChild("cycle"), asset)
        UsdSkel.BindingAPI.Apply(skeleton.GetPrim()).CreateAnimationSourceRel().SetTargets([animation.GetPath()])
        for skinned, where in zip(asset.parts, texture.parts, strict=True):
            child = holder.GetPath().AppendChild(skinned.part.name)
            mesh = write_mesh(stage, child, skinned.part.mesh, where.linear)
            materials.bind(mesh, skinned.part, where)
            _bind(mesh, skinned.weights, skeleton)
        _write_extents(holder, asset.motion)

    write_stage(path, float(asset.motion.seconds[-1]), fill)


def _write_skeleton(stage: Usd.Stage, path: Sdf.Path, skeleton: Skeleton) -> UsdSkel.Skeleton:
    prim = UsdSkel.Skeleton.Define(stage, path)
    prim.CreateJointsAttr(list(skeleton.paths))
    rest = _rest(skeleton)
    prim.CreateBindTransformsAttr([Gf.Matrix4d().SetTranslate(Gf.Vec3d(*map(float, p))) for p in skeleton.pivots])
    prim.CreateRestTransformsAttr([Gf.Matrix4d().SetTranslate(Gf.Vec3d(*map(float, p))) for p in rest])
    return prim


def _rest(skeleton: Skeleton) -> Float[np.ndarray, "joint 3"]:
    parents = [skeleton.parent(j) for j in range(len(skeleton.paths))]
    origin = np.stack([skeleton.pivots[p] if p >= 0 else np.zeros(3) for p in parents])
    return skeleton.pivots - origin


def _write_motion(stage: Usd.Stage, path: Sdf.Path, asset: SkinnedAsset) -> UsdSkel.Animation:
    animation = UsdSkel.Animation.Define(stage, path)
    count = len(asset.skeleton.paths)
    animation.CreateJointsAttr(list(asset.skeleton.paths))
    animation.CreateScalesAttr([Gf.Vec3h(1, 1, 1)] * count)
    rotations, translations = animation.CreateRotationsAttr(), animation.CreateTranslationsAttr()
    shift = (_rest(asset.skeleton) + asset.motion.shift).astype(np.float32)
    for i, seconds in enumerate(asset.motion.seconds):
        code = float(seconds) * TIME_CODES_PER_SECOND
        rotations.Set([Gf.Quatf(*map(float, q)) for q in asset.motion.quaternion[i]], code)
        translations.Set(Vt.Vec3fArray.FromNumpy(shift[i]), code)
    return animation


def _bind(mesh: UsdGeom.Mesh, weights: Float[np.ndarray, "vertex joint"], skeleton: UsdSkel.Skeleton) -> None:
    binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
    indices, share = strongest(weights)
    binding.CreateJointIndicesPrimvar(False, INFLUENCES).Set(Vt.IntArray.FromNumpy(indices.reshape(-1)))
    binding.CreateJointWeightsPrimvar(False, INFLUENCES).Set(Vt.FloatArray.FromNumpy(share.reshape(-1)))
    binding.CreateGeomBindTransformAttr(Gf.Matrix4d(1.0))
    binding.CreateSkeletonRel().SetTargets([skeleton.GetPath()])


def strongest(
    weights: Float[np.ndarray, "vertex joint"],
) -> tuple[Int[np.ndarray, "vertex influence"], Float[np.ndarray, "vertex influence"]]:
    """The largest weights of every vertex, renormalised to sum to 1."""
    order = np.argsort(-weights, axis=1, kind="stable")[:, :INFLUENCES]
    share = np.take_along_axis(weights, order, axis=1)
    return order.astype(np.int32), (share / share.sum(1, keepdims=True)).astype(np.float32)


def _write_extents(root: UsdSkel.Root, motion: Motion) -> None:
    """Bounds at every sample, as UsdSkel itself computes them from joints and skinned meshes."""
    extent = root.CreateExtentAttr()
    for seconds in motion.seconds:
        code = Usd.TimeCode(float(seconds) * TIME_CODES_PER_SECOND)
        extent.Set(UsdGeom.Boundable.ComputeExtentFromPlugins(root, code), code)


def rescaled(asset: SkinnedAsset, factor: float) -> SkinnedAsset:
    """Scale meshes, joints and shifts about the origin."""
    parts = tuple(SkinnedPart(replace(s.part, mesh=scaled(s.part.mesh, factor)), s.weights) for s in asset.parts)
    motion = Motion(asset.motion.seconds, asset.motion.quaternion, asset.motion.shift * factor)
    return SkinnedAsset(parts, Skeleton(asset.skeleton.paths, asset.skeleton.pivots * factor), motion)
