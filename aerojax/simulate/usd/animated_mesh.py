"""An animated USD asset as one triangle mesh: skinning and transforms evaluated from the stage at any time."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int, Int32, UInt8, UInt16
from pxr import Gf, Tf, Usd, UsdGeom

from aerojax.core.errors import UserError
from aerojax.simulate.usd.joints import EvaluateJoints, joint_evaluators
from aerojax.simulate.usd.materials import TextureCache, face_appearance
from aerojax.simulate.usd.skinning import Evaluate, skinned, skinned_prims, transformed


@dataclass(frozen=True)
class AnimatedMesh:
    """The triangles of an asset and where their vertices are at any time.

    faces: vertex indices, counter-clockwise seen from outside.
    albedo: sRGB, 0..1; white where a texture gives the colour.
    uv: texture coordinates of the corners, v upwards; zero without a texture.
    texture: index into `textures`, -1 without one.
    textures: sRGB bytes, top row first.
    part: index into `part_names`.
    part_names: paths of the USD meshes.
    cycle_seconds: length of the animation; 0 if nothing moves.
    """

    faces: Int[np.ndarray, "face 3"]
    albedo: Float[np.ndarray, "face 3"]
    uv: Float[np.ndarray, "face 3 2"]
    texture: Int32[np.ndarray, "face"]
    textures: tuple[UInt8[np.ndarray, "_ _ 3"], ...]
    part: UInt16[np.ndarray, "face"]
    part_names: tuple[str, ...]
    cycle_seconds: float
    _stage: Usd.Stage | None = field(repr=False)  # prims do not keep their stage alive; None without a file
    _evaluate: tuple[Evaluate, ...] = field(repr=False)
    _joints: tuple[EvaluateJoints, ...] = field(repr=False)
    _time_codes_per_second: float = field(repr=False)
    _first_time_code: float = field(repr=False)

    def vertices_at(self, seconds: float) -> Float[np.ndarray, "vertex 3"]:
        """Vertices in the body frame, metres; the animation repeats after `cycle_seconds`, before and after 0."""
        time = self._time_code(seconds)
        return np.concatenate([evaluate(time) for evaluate in self._evaluate]).astype(np.float32, copy=False)

    def joints_at(self, seconds: float) -> dict[str, Float[np.ndarray, "4 4"]]:
        """Rigid `body_from_joint` of skeleton joints and animated prims (rotors), metres, by name."""
        time = self._time_code(seconds)
        return {name: pose for joints in self._joints for name, pose in joints(time).items()}

    def _time_code(self, seconds: float) -> float:
        inside = seconds % self.cycle_seconds if self.cycle_seconds > 0 else 0.0
        return self._first_time_code + inside * self._time_codes_per_second


def load_animated_mesh(path: Path) -> AnimatedMesh:
    """Open a USD file and prepare every visible mesh in it.

    Stages in other units or with +Y up are brought to metres and +Z up. Polygons are split into fans. Colours come from
    the bound materials (see `materials`), else from `displayColor` (linear), and are grey where both are absent.

    Raises:
        UserError: if the file does not exist, cannot be opened, or holds no mesh, or a texture is
            missing.
    """
    stage = _open(path)
    body_from_stage = _body_from_stage(stage)
    bindings = skinned_prims(stage)
    faces, looks, part, names, evaluate, offset = [], [], [], [], [], 0
    textures = TextureCache()
    for prim in stage.Traverse():
        if not prim.IsA(UsdGeom.Mesh) or UsdGeom.Imageable(prim).ComputeVisibility() == UsdGeom.Tokens.invisible:
            continue
        mesh = UsdGeom.Mesh(prim)
        triangles, corners, polygon = _triangles(mesh)
        faces.append(triangles + offset)
        looks.append(face_appearance(mesh, triangles, corners, polygon, textures))
        part.append(np.full(len(triangles), len(names), np.uint16))
        names.append(str(prim.GetPath()))
        binding = bindings.get(prim.GetPath())
        evaluate.append(_moving(mesh, body_from_stage) if binding is None else skinned(mesh, binding, body_from_stage))
        offset += len(mesh.GetPointsAttr().Get(Usd.TimeCode.EarliestTime()))
    if not names:
        raise UserError("missing", f"{path}: the stage holds no visible UsdGeomMesh", "export the object as meshes")
    rate = stage.GetTimeCodesPerSecond()
    return AnimatedMesh(
        faces=np.concatenate(faces).astype(np.int32),
        albedo=np.concatenate([look.albedo for look in looks]).astype(np.float32),
        uv=np.concatenate([look.uv for look in looks]).astype(np.float32),
        texture=np.concatenate([look.texture for look in looks]),
        textures=tuple(textures.pictures),
        part=np.concatenate(part),
        part_names=tuple(names),
        cycle_seconds=max(0.0, (stage.GetEndTimeCode() - stage.GetStartTimeCode()) / rate),
        _stage=stage,
        _evaluate=tuple(evaluate),
        _joints=joint_evaluators(stage, body_from_stage),
        _time_codes_per_second=rate,
        _first_time_code=stage.GetStartTimeCode(),
    )


def _open(path: Path) -> Usd.Stage:
    if not path.is_file():
        raise UserError("missing", f"asset {path} does not exist", "check the path or build the assets first")
    try:
        return Usd.Stage.Open(str(path))
    except Tf.ErrorException as error:
        raise UserError("unreadable", f"asset {path} is not a readable USD file", "export it again") from error


def _body_from_stage(stage: Usd.Stage) -> Gf.Matrix4d:
    # USD matrices act on row vectors.
    matrix = Gf.Matrix4d().SetScale(UsdGeom.GetStageMetersPerUnit(stage))
    if UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.y:
        matrix *= Gf.Matrix4d().SetRotate(Gf.Rotation(Gf.Vec3d(1, 0, 0), 90.0))
    return matrix


def _triangles(
    mesh: UsdGeom.Mesh,
) -> tuple[Int[np.ndarray, "face 3"], Int[np.ndarray, "face 3"], Int[np.ndarray, "face"]]:
    """Fan triangles as vertex indices and as positions among the face vertices, and the polygon each comes from."""
    time = Usd.TimeCode.EarliestTime()
    counts = np.asarray(mesh.GetFaceVertexCountsAttr().Get(time), np.int64)
    vertices = np.asarray(mesh.GetFaceVertexIndicesAttr().Get(time), np.int64)
    start = np.cumsum(counts) - counts
    polygon = np.repeat(np.arange(len(counts)), np.maximum(counts - 2, 0))
    step = np.arange(len(polygon)) - np.searchsorted(polygon, polygon)
    first = start[polygon]
    corners = np.stack([first, first + step + 1, first + step + 2], axis=1)
    if mesh.GetOrientationAttr().Get() == UsdGeom.Tokens.leftHanded:
        corners = corners[:, ::-1]
    return vertices[corners], corners, polygon


def _moving(mesh: UsdGeom.Mesh, body_from_stage: Gf.Matrix4d) -> Evaluate:
    """Vertices of a mesh that only its transforms or point samples move; computed once if nothing does."""

    def at(time: float) -> Float[np.ndarray, "vertex 3"]:
        points = np.asarray(mesh.GetPointsAttr().Get(time), np.float64)
        return transformed(mesh.ComputeLocalToWorldTransform(time) * body_from_stage, points)

    holders, prim = [], mesh.GetPrim()
    while prim and not prim.IsPseudoRoot():
        holders.append(prim)
        prim = prim.GetParent()
    if mesh.GetPointsAttr().ValueMightBeTimeVarying():
        return at
    if not any(UsdGeom.Xformable(p).TransformMightBeTimeVarying() for p in holders if p.IsA(UsdGeom.Xformable)):
        still = at(0.0)
        return lambda time: still
    points = np.asarray(mesh.GetPointsAttr().Get(Usd.TimeCode.EarliestTime()), np.float64)
    return lambda time: transformed(mesh.ComputeLocalToWorldTransform(time) * body_from_stage, points)
