"""Write assets as USD: meshes with extents, normals and colours, rotors as time-sampled transforms.

The stage is metric and +Z up; `displayColor` is linear, as USD has it, while palettes are sRGB. A rotor is a prim whose
`rotateZ` has two time samples, 0 and a whole number of turns: USD interpolates linearly, so the rotation is exact at
every time code and the cycle closes.
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

from aerojax.simulate.assets.shapes import Mesh, Vector, frame_along, scaled
from aerojax.simulate.assets.variation import Palette, draw_palette, face_colours

TIME_CODES_PER_SECOND = 120.0
CREASE_COSINE = float(np.cos(np.deg2rad(42.0)))
"""Neighbouring faces that turn by less than 42 degrees share a smooth normal."""


@dataclass(frozen=True)
class Spin:
    """A steady rotation: hub in the body frame (metres), axis, rate (negative is clockwise about the axis), phase."""

    hub: Vector
    axis: Vector
    hertz: float
    phase_degrees: float = 0.0


@dataclass(frozen=True)
class Part:
    """One mesh of an asset; `role` picks its colour (0 is the skin); a spinning mesh has its hub at its origin."""

    name: str
    mesh: Mesh
    role: int = 0
    spin: Spin | None = None


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


def linear_from_srgb(srgb: Float[np.ndarray, "*shape"]) -> Float[np.ndarray, "*shape"]:
    """Decode sRGB (IEC 61966-2-1)."""
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def face_normals(mesh: Mesh) -> Float[np.ndarray, "face 3"]:
    """Normals scaled by twice the faces' areas."""
    a, b, c = (mesh.points[mesh.faces[:, i]] for i in range(3))
    return np.cross(b - a, c - a)


def corner_normals(mesh: Mesh) -> Float[np.ndarray, "corner 3"]:
    """Unit normals, three a face: the area-weighted mean over the vertex's faces within the crease angle."""
    area_normal = face_normals(mesh)
    unit = area_normal / np.linalg.norm(area_normal, axis=1, keepdims=True).clip(1e-20)
    vertex, face = mesh.faces.reshape(-1), np.repeat(np.arange(len(mesh.faces)), 3)
    order = np.argsort(vertex, kind="stable")
    start = np.searchsorted(vertex[order], np.arange(len(mesh.points) + 1))
    valence = np.diff(start)[vertex]
    one = np.repeat(np.arange(len(vertex)), valence)
    step = np.arange(len(one)) - np.repeat(np.cumsum(valence) - valence, valence)
    other = order[start[vertex[one]] + step]
    near = np.einsum("ij,ij->i", unit[face[one]], unit[face[other]]) > CREASE_COSINE
    total = np.zeros((len(vertex), 3))
    np.add.at(total, one[near], area_normal[face[other[near]]])
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.where(length > 1e-20, total / length.clip(1e-20), unit[face])


def write_stage(path: Path, cycle_seconds: float, fill: Callable[[Usd.Stage, Sdf.Path], None]) -> None:
    """Create a stage, let `fill` author under its default prim, save it and move it to `path` in one step."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f".{path.stem}.{os.getpid()}.usdc")
    stage = Usd.Stage.CreateNew(str(partial))
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
    stage.GetRootLayer().Save()
    partial.replace(path)


def write_mesh(stage: Usd.Stage, path: Sdf.Path, mesh: Mesh, srgb: Float[np.ndarray, "face 3"]) -> UsdGeom.Mesh:
    """Author one closed triangle mesh with per-corner normals, per-face colour and its extent."""
    prim = UsdGeom.Mesh.Define(stage, path)
    points = mesh.points.astype(np.float32)
    prim.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
    prim.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(mesh.faces), 3, np.int32)))
    prim.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(mesh.faces.astype(np.int32).reshape(-1)))
    prim.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    prim.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(corner_normals(mesh).astype(np.float32)))
    prim.SetNormalsInterpolation(UsdGeom.Tokens.faceVarying)
    prim.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(np.stack([points.min(0), points.max(0)])))
    colours, which = np.unique(linear_from_srgb(srgb).astype(np.float32), axis=0, return_inverse=True)
    uniform = len(colours) > 1
    variable = prim.CreateDisplayColorPrimvar(UsdGeom.Tokens.uniform if uniform else UsdGeom.Tokens.constant)
    variable.Set(Vt.Vec3fArray.FromNumpy(colours))
    if uniform:
        variable.SetIndices(Vt.IntArray.FromNumpy(which.reshape(-1).astype(np.int32)))
    return prim


def paint(palette: Palette, part: Part, half_width: float) -> Float[np.ndarray, "face 3"]:
    """sRGB colours of a part's faces under the palette's pattern."""
    normal = face_normals(part.mesh)
    unit = normal / np.linalg.norm(normal, axis=1, keepdims=True).clip(1e-20)
    width = np.abs(part.mesh.points[part.mesh.faces, 1].mean(1)) / half_width
    return face_colours(palette, part.role, unit, width)


def write_asset(path: Path, asset: Asset, colour_seed: int) -> None:
    """Write fixed and spinning parts; spinning parts complete whole turns in the asset's cycle."""
    palette = draw_palette(colour_seed)
    half_width = max(float(np.abs(p.mesh.points[:, 1]).max()) for p in asset.parts if p.spin is None)

    def fill(stage: Usd.Stage, root: Sdf.Path) -> None:
        for part in asset.parts:
            holder = root if part.spin is None else _spinner(stage, root.AppendChild(part.name), part.spin, asset)
            child = holder.AppendChild(part.name if part.spin is None else "mesh")
            write_mesh(stage, child, part.mesh, paint(palette, part, half_width))

    write_stage(path, asset.cycle_seconds, fill)


def _spinner(stage: Usd.Stage, path: Sdf.Path, spin: Spin, asset: Asset) -> Sdf.Path:
    holder = UsdGeom.Xform.Define(stage, path)
    holder.AddTranslateOp().Set(Gf.Vec3d(*spin.hub))
    holder.AddOrientOp(UsdGeom.XformOp.PrecisionDouble).Set(_quaternion(frame_along(np.asarray(spin.axis, float))))
    turns = max(1, round(abs(spin.hertz) * asset.cycle_seconds)) * (1 if spin.hertz >= 0 else -1)
    rotate = holder.AddRotateZOp(UsdGeom.XformOp.PrecisionDouble)
    rotate.Set(spin.phase_degrees, 0.0)
    rotate.Set(spin.phase_degrees + 360.0 * turns, asset.cycle_seconds * TIME_CODES_PER_SECOND)
    return path


def _quaternion(rotation: Float[np.ndarray, "3 3"]) -> Gf.Quatd:
    columns = Gf.Matrix3d(*(float(v) for v in rotation.T.reshape(-1)))
    return columns.ExtractRotation().GetQuat()
