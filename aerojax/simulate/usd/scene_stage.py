"""A planned scene as a USD stage: objects by reference with their keyframed flights, cameras, sun and landscape."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, Vt

from aerojax.capture.format import CaptureCamera
from aerojax.core.usd_files import create_stage, save_stage
from kernels.rays.landscape import LandscapeMesh

_FIRST_OBJECT = Sdf.Path("/World/Object")
_USD_FROM_OPENCV = np.diag([1.0, -1.0, -1.0, 1.0])  # USD cameras look along -z with +y up


@dataclass(frozen=True)
class StageObject:
    """An object of a scene: its own stage, and where its body is at time code 0, 1 … (metres, world).

    offset_seconds: where in its own animation the object is at time code 0. Whole cycles are left out: USD holds the
        last pose of an animation that has ended, where `AnimatedMesh` repeats it.
    """

    asset: Path
    world_from_body: Float[np.ndarray, "time 4 4"]
    offset_seconds: float = 0.0


def write_scene_stage(
    path: Path,
    objects: Sequence[StageObject],
    cameras: Sequence[CaptureCamera],
    *,
    fps: float,
    sun: Float[np.ndarray, "time 3"] | None = None,
    landscape: Path | None = None,
) -> None:
    """Write the stage of one sequence; frame i is time code i.

    Args:
        path: `.usda` or `.usdc` to write; what it references is named relative to it.
        objects: in the order of their mask values, all with the same number of frames.
        cameras: static.
        fps: time codes per second.
        sun: unit vectors to the sun, one a frame or a single one; no sun light if None.
        landscape: a stage from `write_landscape_stage`.
    """
    stage = create_stage(path)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetTimeCodesPerSecond(fps)
    stage.SetStartTimeCode(0)
    stage.SetEndTimeCode(max(len(o.world_from_body) for o in objects) - 1)
    world = UsdGeom.Xform.Define(stage, "/World")
    Usd.ModelAPI(world).SetKind("assembly")
    stage.SetDefaultPrim(world.GetPrim())
    for index, item in enumerate(objects):
        _author_object(stage, object_path(index), item, path.parent, fps)
    for camera in cameras:
        _author_camera(stage, camera)
    if sun is not None:
        _author_sun(stage, sun)
    if landscape is not None:
        ground = stage.DefinePrim("/World/Scenery")
        ground.GetReferences().AddReference(_relative(landscape, path.parent))
    save_stage(stage)


def object_path(index: int) -> Sdf.Path:
    """Prim path of the object with mask value `index` + 1: Object, Object_2, Object_3 …"""
    return _FIRST_OBJECT if index == 0 else Sdf.Path(f"{_FIRST_OBJECT}_{index + 1}")


def _author_object(stage: Usd.Stage, path: Sdf.Path, item: StageObject, folder: Path, fps: float) -> None:
    body = UsdGeom.Xform.Define(stage, path)
    # USD itself brings the asset's time codes to the stage's rate; the offset is in the stage's.
    shift = Sdf.LayerOffset(-_within_cycle(item) * fps)
    body.GetPrim().GetReferences().AddReference(_relative(item.asset, folder), shift)
    body.ClearXformOpOrder()
    pose = body.AddTransformOp(UsdGeom.XformOp.PrecisionDouble, "flight")
    for frame, matrix in enumerate(item.world_from_body):
        pose.Set(Gf.Matrix4d(*matrix.T.ravel().tolist()), frame)  # USD matrices act on row vectors


def _within_cycle(item: StageObject) -> float:
    """Seconds into the asset's animation at time code 0, less than a cycle."""
    layer = Sdf.Layer.FindOrOpen(str(item.asset))
    cycle = (layer.endTimeCode - layer.startTimeCode) / layer.timeCodesPerSecond
    return item.offset_seconds % cycle if cycle > 0 else 0.0


def _relative(asset: Path, folder: Path) -> str:
    """The asset's path as seen from a layer's folder, so that the two can move together; it starts with a dot.

    USD looks for paths that do not in its search path too.
    """
    relative = Path(os.path.relpath(asset.resolve(), folder.resolve())).as_posix()
    return relative if relative.startswith(".") else f"./{relative}"


def _author_camera(stage: Usd.Stage, camera: CaptureCamera) -> None:
    prim = UsdGeom.Camera.Define(stage, f"/World/{camera.name}")
    matrix = (camera.world_from_cam @ _USD_FROM_OPENCV).T
    prim.AddTransformOp().Set(Gf.Matrix4d(*matrix.ravel().tolist()))
    # Apertures and focal length are in tenths of a stage unit; only their ratio matters for a pinhole.
    aperture = 36.0
    pixel = aperture / camera.width
    prim.CreateHorizontalApertureAttr(aperture)
    prim.CreateVerticalApertureAttr(pixel * camera.height * float(camera.K[0, 0] / camera.K[1, 1]))
    prim.CreateFocalLengthAttr(float(camera.K[0, 0]) * pixel)
    # Offsets move the film right and up, the principal point left and down.
    prim.CreateHorizontalApertureOffsetAttr(pixel * float(camera.width / 2 - camera.K[0, 2]))
    prim.CreateVerticalApertureOffsetAttr(pixel * float(camera.K[1, 2] - camera.height / 2))
    prim.CreateClippingRangeAttr(Gf.Vec2f(0.1, 10000.0))


def _author_sun(stage: Usd.Stage, directions: Float[np.ndarray, "time 3"]) -> None:
    """A distant light, which shines along its own -z."""
    light = UsdLux.DistantLight.Define(stage, "/World/Sun")
    light.CreateAngleAttr(0.53)
    light.CreateIntensityAttr(1.0)
    turn = light.AddTransformOp(UsdGeom.XformOp.PrecisionDouble)
    for frame, direction in enumerate(directions):
        rotation = Gf.Rotation(Gf.Vec3d(0, 0, 1), Gf.Vec3d(*(float(v) for v in direction)))
        matrix = Gf.Matrix4d().SetRotate(rotation)
        if len(directions) == 1:
            turn.Set(matrix)
        else:
            turn.Set(matrix, frame)


def write_landscape_stage(path: Path, landscape: LandscapeMesh) -> None:
    """Write a landscape as a stage of one mesh with a linear `displayColor` a face; grain is the renderer's own."""
    stage = create_stage(path)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    root = UsdGeom.Xform.Define(stage, "/Scenery")
    Usd.ModelAPI(root).SetKind("component")
    stage.SetDefaultPrim(root.GetPrim())
    mesh = UsdGeom.Mesh.Define(stage, "/Scenery/Land")
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(landscape.vertices))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(landscape.faces), 3, np.int32)))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(landscape.faces.ravel()))
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    ends = np.stack([landscape.vertices.min(axis=0), landscape.vertices.max(axis=0)])
    mesh.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(ends))
    colours, which = np.unique(landscape.albedo, axis=0, return_inverse=True)
    variable = mesh.CreateDisplayColorPrimvar(UsdGeom.Tokens.uniform)
    variable.Set(Vt.Vec3fArray.FromNumpy(colours))
    variable.SetIndices(Vt.IntArray.FromNumpy(which.reshape(-1).astype(np.int32)))
    save_stage(stage)


def body_poses(path: Path, index: int = 0) -> Float[np.ndarray, "time 4 4"]:
    """`world_from_body` of an object at every time code of a scene's stage."""
    stage = Usd.Stage.Open(str(path))
    prim = stage.GetPrimAtPath(object_path(index))
    codes = range(int(stage.GetStartTimeCode()), int(stage.GetEndTimeCode()) + 1)
    caches = (UsdGeom.XformCache(Usd.TimeCode(code)) for code in codes)
    return np.stack([np.array(cache.GetLocalToWorldTransform(prim)).T for cache in caches])
