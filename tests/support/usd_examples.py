"""Small USD stages for tests: boxes, spheres and a textured quad."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import trimesh
from pxr import Sdf, Usd, UsdGeom, UsdShade


def open_stage(path: Path) -> Usd.Stage:
    """A new metric stage with +Z up."""
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, "Z")
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    return stage


def write_solid(path: Path, solid: trimesh.Trimesh, linear: tuple[float, float, float] = (0.5, 0.5, 0.5)) -> Path:
    """A stage with one mesh of one colour."""
    stage = open_stage(path)
    mesh = UsdGeom.Mesh.Define(stage, "/solid")
    mesh.CreatePointsAttr(np.asarray(solid.vertices, np.float32))
    mesh.CreateFaceVertexCountsAttr([3] * len(solid.faces))
    mesh.CreateFaceVertexIndicesAttr(np.asarray(solid.faces, np.int32).ravel())
    mesh.CreateDisplayColorPrimvar("constant").Set([linear])
    stage.Save()
    return path


def define_quad(stage: Usd.Stage, name: str, x: float = 0.0) -> UsdGeom.Mesh:
    """A unit square at x that looks along +X, with `st` a face vertex: u along +Y, v along +Z."""
    mesh = UsdGeom.Mesh.Define(stage, name)
    mesh.CreatePointsAttr([(x, -0.5, -0.5), (x, 0.5, -0.5), (x, 0.5, 0.5), (x, -0.5, 0.5)])
    mesh.CreateFaceVertexCountsAttr([4])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 2, 3])
    st = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, "faceVarying")
    st.Set([(0, 0), (1, 0), (1, 1), (0, 1)])
    return mesh


def define_textured_material(stage: Usd.Stage, name: str, file: str) -> UsdShade.Material:
    """UsdPreviewSurface with its diffuse colour from a picture."""
    material = UsdShade.Material.Define(stage, name)
    surface = UsdShade.Shader.Define(stage, f"{name}/surface")
    surface.CreateIdAttr("UsdPreviewSurface")
    picture = UsdShade.Shader.Define(stage, f"{name}/picture")
    picture.CreateIdAttr("UsdUVTexture")
    picture.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(file)
    reader = UsdShade.Shader.Define(stage, f"{name}/reader")
    reader.CreateIdAttr("UsdPrimvarReader_float2")
    reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("st")
    st = picture.CreateInput("st", Sdf.ValueTypeNames.Float2)
    st.ConnectToSource(reader.CreateOutput("result", Sdf.ValueTypeNames.Float2))
    colour = surface.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f)
    colour.ConnectToSource(picture.CreateOutput("rgb", Sdf.ValueTypeNames.Float3))
    material.CreateSurfaceOutput().ConnectToSource(surface.ConnectableAPI(), "surface")
    return material


def write_picture(path: Path, rgb: np.ndarray) -> None:
    """sRGB bytes as a PNG."""
    path.write_bytes(cv2.imencode(".png", np.ascontiguousarray(rgb[..., ::-1]))[1].tobytes())
