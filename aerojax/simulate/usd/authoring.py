"""Write assets as USD: meshes with extents, normals and textures, rotors as time-sampled transforms.

The stage is metric and +Z up. Its texture lies beside it under the same stem and is sRGB; `displayColor`, the fallback
of readers without materials, is linear, as USD has it. A rotor is a prim whose `rotateZ` has two time samples, 0 and a
whole number of turns: USD interpolates linearly, so the rotation is exact at every time code and the cycle closes.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float
from pxr import Gf, Sdf, Usd, UsdGeom, Vt

from aerojax.core.usd_files import create_stage, save_stage
from aerojax.simulate.assets.mesh.parts import Part, Spin, corner_normals
from aerojax.simulate.assets.mesh.shapes import Mesh, frame_along, scaled
from aerojax.simulate.assets.paint.materials import Materials, bake_texture

TIME_CODES_PER_SECOND = 120.0


@dataclass(frozen=True)
class Asset:
    """Parts in the body frame (nose +X, up +Z) and the length of the animation's cycle."""

    parts: tuple[Part, ...]
    cycle_seconds: float = 1.0


def normalised(asset: Asset, size: float) -> Asset:
    """Scale an asset by 1/size and put the middle of its fixed parts' bounding box at the origin (y stays)."""
    fixed = np.concatenate([p.mesh.points for p in asset.parts if p.spin is None])
    middle = (fixed.min(0) + fixed.max(0)) / 2 * np.array([1.0, 0.0, 1.0])
    return replace(asset, parts=tuple(_placed(part, middle, 1.0 / size) for part in asset.parts))


def _placed(part: Part, middle: Float[np.ndarray, "3"], factor: float) -> Part:
    if part.spin is None:
        return replace(part, mesh=scaled(Mesh(part.mesh.points - middle, part.mesh.faces), factor))
    x, y, z = (float(v) for v in (np.asarray(part.spin.hub) - middle) * factor)
    return replace(part, mesh=scaled(part.mesh, factor), spin=replace(part.spin, hub=(x, y, z)))


def row_matrix(matrix: Float[np.ndarray, "4 4"]) -> Gf.Matrix4d:
    """A transform of column vectors as USD has it, which multiplies row vectors."""
    return Gf.Matrix4d(*matrix.T.reshape(-1).tolist())


def write_stage(path: Path, cycle_seconds: float, fill: Callable[[Usd.Stage, Sdf.Path], None]) -> None:
    """Create a stage, let `fill` author under its default prim, save it and move it to `path` in one step."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f".{path.stem}.{os.getpid()}.usdc")
    stage = create_stage(partial)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetTimeCodesPerSecond(TIME_CODES_PER_SECOND)
    stage.SetFramesPerSecond(30.0)
    stage.SetStartTimeCode(0.0)
    stage.SetEndTimeCode(cycle_seconds * TIME_CODES_PER_SECOND)
    root = UsdGeom.Xform.Define(stage, "/" + re.sub(r"\W", "_", path.stem))
    stage.SetDefaultPrim(root.GetPrim())
    Usd.ModelAPI(root).SetKind("component")
    fill(stage, root.GetPath())
    save_stage(stage)
    partial.replace(path)


def write_mesh(stage: Usd.Stage, path: Sdf.Path, mesh: Mesh, linear: Float[np.ndarray, "face 3"]) -> UsdGeom.Mesh:
    """Author one closed triangle mesh with per-corner normals, per-face `displayColor` (linear) and its extent."""
    prim = UsdGeom.Mesh.Define(stage, path)
    points = mesh.points.astype(np.float32)
    prim.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
    prim.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(mesh.faces), 3, np.int32)))
    prim.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(mesh.faces.astype(np.int32).reshape(-1)))
    prim.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    prim.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(corner_normals(mesh).astype(np.float32)))
    prim.SetNormalsInterpolation(UsdGeom.Tokens.faceVarying)
    prim.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(np.stack([points.min(0), points.max(0)])))
    colours, which = np.unique(linear.astype(np.float32), axis=0, return_inverse=True)
    uniform = len(colours) > 1
    variable = prim.CreateDisplayColorPrimvar(UsdGeom.Tokens.uniform if uniform else UsdGeom.Tokens.constant)
    variable.Set(Vt.Vec3fArray.FromNumpy(colours))
    if uniform:
        variable.SetIndices(Vt.IntArray.FromNumpy(which.reshape(-1).astype(np.int32)))
    return prim


def write_asset(path: Path, asset: Asset, colour_seed: int) -> None:
    """Write fixed and spinning parts; spinning parts complete whole turns in the asset's cycle."""
    texture = bake_texture(path, asset.parts, colour_seed)

    def fill(stage: Usd.Stage, root: Sdf.Path) -> None:
        materials = Materials(stage, root.AppendChild("materials"), texture)
        for part, where in zip(asset.parts, texture.parts, strict=True):
            holder = root if part.spin is None else _spinner(stage, root.AppendChild(part.name), part.spin, asset)
            child = holder.AppendChild(part.name if part.spin is None else "mesh")
            materials.bind(write_mesh(stage, child, part.mesh, where.linear), part, where)

    write_stage(path, asset.cycle_seconds, fill)


def whole_turns(spin: Spin, cycle_seconds: float) -> int:
    """Signed turns of a rotor in a cycle: the nearest whole number, at least one unless the rotor stands."""
    if spin.hertz == 0:
        return 0
    return max(1, round(abs(spin.hertz) * cycle_seconds)) * (1 if spin.hertz > 0 else -1)


def _spinner(stage: Usd.Stage, path: Sdf.Path, spin: Spin, asset: Asset) -> Sdf.Path:
    holder = UsdGeom.Xform.Define(stage, path)
    holder.AddTranslateOp().Set(Gf.Vec3d(*spin.hub))
    holder.AddOrientOp(UsdGeom.XformOp.PrecisionDouble).Set(_quaternion(frame_along(np.asarray(spin.axis, float))))
    turns = whole_turns(spin, asset.cycle_seconds)
    rotate = holder.AddRotateZOp(UsdGeom.XformOp.PrecisionDouble)
    rotate.Set(spin.phase_degrees, 0.0)
    rotate.Set(spin.phase_degrees + 360.0 * turns, asset.cycle_seconds * TIME_CODES_PER_SECOND)
    return path


def _quaternion(rotation: Float[np.ndarray, "3 3"]) -> Gf.Quatd:
    columns = Gf.Matrix3d(*(float(v) for v in rotation.T.reshape(-1)))
    return columns.ExtractRotation().GetQuat()
