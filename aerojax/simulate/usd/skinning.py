"""UsdSkel deformation at any time: blend shapes, then linear-blend skinning, both evaluated by UsdSkel itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel, Vt

from aerojax.core.errors import UserError

Evaluate = Callable[[float], Float[np.ndarray, "vertex 3"]]
"""Positions of one prim's vertices in the body frame (metres) at a time code."""


@dataclass(frozen=True)
class Binding:
    """How a skeleton deforms one mesh; `cache` owns what the queries point to."""

    skeleton: UsdSkel.SkeletonQuery
    skin: UsdSkel.SkinningQuery
    cache: UsdSkel.Cache


def transformed(matrix: Gf.Matrix4d, points: Float[np.ndarray, "vertex 3"]) -> Float[np.ndarray, "vertex 3"]:
    """Points moved by a USD matrix (which acts on row vectors), as float32."""
    rows = np.asarray(matrix, np.float64)
    return (points @ rows[:3, :3] + rows[3, :3]).astype(np.float32)


def skinned_prims(stage: Usd.Stage) -> dict[Sdf.Path, Binding]:
    """Every mesh that a skeleton moves or a skeleton's animation morphs, by path."""
    found: dict[Sdf.Path, Binding] = {}
    everything = Usd.TraverseInstanceProxies(Usd.PrimAllPrimsPredicate)  # prototypes of instancers may be classes
    for prim in stage.Traverse(everything):
        if not prim.IsA(UsdSkel.Root):
            continue
        root, cache = UsdSkel.Root(prim), UsdSkel.Cache()
        cache.Populate(root, everything)
        for binding in cache.ComputeSkelBindings(root, everything):
            query = cache.GetSkelQuery(binding.GetSkeleton())
            for target in binding.GetSkinningTargets():
                found[target.GetPrim().GetPath()] = Binding(query, target, cache)
    return found


def skinned(mesh: UsdGeom.Mesh, binding: Binding, body_from_prim: Callable[[Usd.Prim, float], Gf.Matrix4d]) -> Evaluate:
    """Vertices of a bound mesh in the body frame.

    Skinned points come out in the skeleton's space; points that are only morphed stay in the mesh's own.

    Args:
        mesh: that the binding is of.
        binding: how it is deformed.
        body_from_prim: of a prim at a time code.

    Returns:
        The evaluation, which raises a UserError naming the mesh where its joints do not fit its skeleton.
    """
    points = mesh.GetPointsAttr().Get(Usd.TimeCode.EarliestTime())
    morph = _blend_shapes(binding)
    bends = binding.skin.HasJointInfluences()
    holder = skinned_by(mesh, binding)

    def at(time: float) -> Float[np.ndarray, "vertex 3"]:
        moved = Vt.Vec3fArray(points)
        if morph is not None:
            morph(time, moved)
        if bends:
            joints = binding.skeleton.ComputeSkinningTransforms(time)
            if not joints or not binding.skin.ComputeSkinnedPoints(joints, moved, time):
                raise UserError(
                    "invalid",
                    f"{mesh.GetPath()}: its joints do not fit its skeleton's joints and transforms",
                    "bind it again",
                )
        return transformed(body_from_prim(holder, time), np.asarray(moved, np.float64))

    return at


def skinned_by(mesh: UsdGeom.Mesh, binding: Binding) -> Usd.Prim:
    """The prim in whose space a bound mesh's points come out: its skeleton if it has joints, else itself."""
    return binding.skeleton.GetPrim() if binding.skin.HasJointInfluences() else mesh.GetPrim()


def _blend_shapes(binding: Binding) -> Callable[[float, Vt.Vec3fArray], None] | None:
    """Add the blend shapes' offsets at a time code to points, in place; None where nothing drives them."""
    animation = binding.skeleton.GetAnimQuery()
    if not binding.skin.HasBlendShapes() or not animation or not len(animation.GetBlendShapeOrder()):
        return None
    query = UsdSkel.BlendShapeQuery(UsdSkel.BindingAPI(binding.skin.GetPrim()))
    mapper = binding.skin.GetBlendShapeMapper()
    rows, offsets = query.ComputeBlendShapePointIndices(), query.ComputeSubShapePointOffsets()

    def add(time: float, moved: Vt.Vec3fArray) -> None:
        driven = animation.ComputeBlendShapeWeights(time)
        weights, shapes, subshapes = query.ComputeSubShapeWeights(driven if mapper is None else mapper.Remap(driven))
        query.ComputeDeformedPoints(weights, shapes, subshapes, rows, offsets, moved)

    return add
