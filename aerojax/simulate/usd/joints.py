"""Moving frames of a stage: joints of UsdSkel skeletons and prims whose own transform is animated (rotors)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import Float
from pxr import Gf, Usd, UsdGeom, UsdSkel

EvaluateJoints = Callable[[float], dict[str, Float[np.ndarray, "4 4"]]]
"""Names and rigid `body_from_joint` at a time code."""


def joint_evaluators(stage: Usd.Stage, body_from_stage: Gf.Matrix4d) -> tuple[EvaluateJoints, ...]:
    """One evaluator a skeleton or animated transform; names are joint paths, and prim paths below the default prim."""
    found: list[EvaluateJoints] = []
    cache = UsdSkel.Cache()
    for prim in stage.Traverse():
        if prim.IsA(UsdSkel.Root):
            cache.Populate(UsdSkel.Root(prim), Usd.PrimDefaultPredicate)
        if prim.IsA(UsdSkel.Skeleton):
            found.append(_skeleton(cache.GetSkelQuery(UsdSkel.Skeleton(prim)), cache, body_from_stage))
        elif prim.IsA(UsdGeom.Xformable) and UsdGeom.Xformable(prim).TransformMightBeTimeVarying():
            found.append(_transform(prim, body_from_stage))
    return tuple(found)


def _skeleton(query: UsdSkel.SkeletonQuery, cache: UsdSkel.Cache, body_from_stage: Gf.Matrix4d) -> EvaluateJoints:
    names = [str(name) for name in query.GetJointOrder()]

    def at(time: float, _alive: UsdSkel.Cache = cache) -> dict[str, Float[np.ndarray, "4 4"]]:
        holder = UsdGeom.Xformable(query.GetPrim()).ComputeLocalToWorldTransform(time) * body_from_stage
        in_skeleton = query.ComputeJointSkelTransforms(time)
        return {name: _rigid(matrix * holder) for name, matrix in zip(names, in_skeleton, strict=True)}

    return at


def _transform(prim: Usd.Prim, body_from_stage: Gf.Matrix4d) -> EvaluateJoints:
    root = prim.GetStage().GetDefaultPrim()
    path = prim.GetPath()
    inside = bool(root) and path != root.GetPath() and path.HasPrefix(root.GetPath())
    name = str(path.MakeRelativePath(root.GetPath())) if inside else str(path)

    def at(time: float) -> dict[str, Float[np.ndarray, "4 4"]]:
        return {name: _rigid(UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(time) * body_from_stage)}

    return at


def _rigid(matrix: Gf.Matrix4d) -> Float[np.ndarray, "4 4"]:
    """Column-vector transform without scale or shear: position kept, rotation the nearest proper one."""
    columns = np.array(matrix, np.float64).T
    left, _, right = np.linalg.svd(columns[:3, :3])
    rigid = np.eye(4)
    rigid[:3, :3] = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
    rigid[:3, 3] = columns[:3, 3]
    return rigid
