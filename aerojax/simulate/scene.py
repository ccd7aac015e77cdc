"""A sequence as a USD stage: the asset by reference, its keyframed flight and the cameras of the rig."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from jaxtyping import Float
from pxr import Gf, Sdf, Usd, UsdGeom

from aerojax.capture.format import CaptureCamera
from aerojax.simulate.flight import Flight

BODY = Sdf.Path("/World/Object")
_USD_FROM_OPENCV = np.diag([1.0, -1.0, -1.0, 1.0])  # USD cameras look along -z with +y up


def author_scene(
    path: Path,
    asset: Path,
    flight: Flight,
    cameras: tuple[CaptureCamera, ...],
    *,
    fps: float,
    origin: Float[np.ndarray, "3"],
) -> None:
    """Write the stage of one sequence.

    Args:
        path: `.usda` or `.usdc` to write.
        asset: the identity's stage, referenced by a path relative to `path`.
        flight: poses about the origin, one a frame; frame i is time code i.
        cameras: static cameras of the rig.
        fps: time codes per second.
        origin: where the middle of the flight lies, metres, world.
    """
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetTimeCodesPerSecond(fps)
    stage.SetStartTimeCode(0)
    stage.SetEndTimeCode(len(flight.position) - 1)
    world = UsdGeom.Xform.Define(stage, "/World")
    stage.SetDefaultPrim(world.GetPrim())
    body = UsdGeom.Xform.Define(stage, BODY)
    body.GetPrim().GetReferences().AddReference(_relative(asset, path.parent))
    body.ClearXformOpOrder()
    pose = body.AddTransformOp(UsdGeom.XformOp.PrecisionDouble, "flight")
    for frame, (position, rotation) in enumerate(zip(flight.position + origin, flight.world_from_body, strict=True)):
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = rotation, position
        pose.Set(Gf.Matrix4d(*matrix.T.ravel().tolist()), frame)  # USD matrices act on row vectors
    for camera in cameras:
        _author_camera(stage, camera)
    stage.GetRootLayer().Save()


def _relative(asset: Path, folder: Path) -> str:
    """The asset's path as seen from a layer's folder, so that the two can move together."""
    return Path(os.path.relpath(asset.resolve(), folder.resolve())).as_posix()


def _author_camera(stage: Usd.Stage, camera: CaptureCamera) -> None:
    prim = UsdGeom.Camera.Define(stage, f"/World/{camera.name}")
    matrix = (camera.world_from_cam @ _USD_FROM_OPENCV).T
    prim.AddTransformOp().Set(Gf.Matrix4d(*matrix.ravel().tolist()))
    # Apertures and focal length are in tenths of a stage unit; only their ratio matters for a pinhole.
    aperture = 36.0
    prim.CreateHorizontalApertureAttr(aperture)
    prim.CreateVerticalApertureAttr(aperture * camera.height / camera.width)
    prim.CreateFocalLengthAttr(float(aperture * camera.K[0, 0] / camera.width))
    prim.CreateClippingRangeAttr(Gf.Vec2f(0.1, 10000.0))


def body_poses(path: Path) -> Float[np.ndarray, "time 4 4"]:
    """`world_from_body` at every time code of a scene's stage."""
    stage = Usd.Stage.Open(str(path))
    prim = stage.GetPrimAtPath(BODY)
    codes = range(int(stage.GetStartTimeCode()), int(stage.GetEndTimeCode()) + 1)
    caches = (UsdGeom.XformCache(Usd.TimeCode(code)) for code in codes)
    return np.stack([np.array(cache.GetLocalToWorldTransform(prim)).T for cache in caches])
