"""Users' own USD stages: units, axes, time, textures, instances, skeletons, and their mistakes."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade, UsdSkel, UsdUtils
from support.model_imports import IMAGE, import_model, relative, shown

from aerojax.core.errors import UserError
from aerojax.simulate.usd.animated_mesh import load_animated_mesh


def _mesh(stage, path, points=((0, 0, 0), (100, 0, 0), (0, 200, 0))):
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr(points)
    mesh.CreateFaceVertexCountsAttr([3])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 2])
    return mesh


def _paint(stage, path, file):
    """A textured material on its own root prim."""
    material, types = UsdShade.Material.Define(stage, path), Sdf.ValueTypeNames
    reader = UsdShade.Shader.Define(stage, f"{path}/st")
    reader.CreateIdAttr("UsdPrimvarReader_float2")
    reader.CreateInput("varname", types.String).Set("st")
    texture = UsdShade.Shader.Define(stage, f"{path}/texture")
    texture.CreateIdAttr("UsdUVTexture")
    texture.CreateInput("file", types.Asset).Set(Sdf.AssetPath(file))
    texture.CreateInput("st", types.Float2).ConnectToSource(reader.CreateOutput("result", types.Float2))
    surface = UsdShade.Shader.Define(stage, f"{path}/surface")
    surface.CreateIdAttr("UsdPreviewSurface")
    surface.CreateInput("diffuseColor", types.Color3f).ConnectToSource(texture.CreateOutput("rgb", types.Float3))
    material.CreateSurfaceOutput().ConnectToSource(surface.CreateOutput("surface", types.Token))
    return material


def _stage(folder, name="model.usda"):
    """Centimetres, +Y up, 24 time codes a second from 10 on: two root prims, a light, a camera, a texture."""
    assert cv2.imwrite(str(folder / "skin.png"), IMAGE[..., ::-1])
    stage = Usd.Stage.CreateNew(str(folder / name))
    UsdGeom.SetStageUpAxis(stage, "Y")
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    stage.SetTimeCodesPerSecond(24)
    stage.SetStartTimeCode(10)
    stage.SetEndTimeCode(34)
    mesh = _mesh(stage, "/bird/body")
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/bird").GetPrim())
    variable = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, "vertex")
    variable.Set([(0, 0.6), (1, 0.6), (0, 1)])
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(_paint(stage, "/looks/paint", "./skin.png"))
    move = UsdGeom.Xformable(_mesh(stage, "/bird/wing")).AddTranslateOp()
    move.Set((0, 0, 0), 10)
    move.Set((0, 0, 240), 34)
    UsdLux.SphereLight.Define(stage, "/lamp")
    UsdGeom.Camera.Define(stage, "/view")
    return stage


def test_usd_units_axes_time_and_textures(tmp_path):
    _stage(tmp_path).Save()
    mesh = import_model(tmp_path, "model.usda", "scale: 0.01, forward: +Z, speed: 2.0")
    assert mesh.cycle_seconds == pytest.approx(0.5)
    assert relative(mesh, 0.0)[:3] == pytest.approx(np.array([[0, 0, 0], [0, 1, 0], [0, 0, 2]]), abs=1e-6)
    assert relative(mesh, 0.25)[3] == pytest.approx([1.2, 0, 0], abs=1e-6)
    assert relative(mesh, 0.375)[3] == pytest.approx([1.8, 0, 0], abs=1e-6)
    assert shown(mesh) == [200, 40, 20]
    stage = Usd.Stage.Open(str(tmp_path / "assets" / "model.usdc"))
    assert not [p for p in stage.Traverse() if p.IsA(UsdGeom.Camera) or p.HasAPI(UsdLux.LightAPI)]


def test_usdz_brings_its_textures(tmp_path):
    _stage(tmp_path).Save()
    assert UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(str(tmp_path / "model.usda")), str(tmp_path / "model.usdz"))
    (tmp_path / "skin.png").unlink()
    assert shown(import_model(tmp_path, "model.usdz", "scale: 0.01, forward: +Z")) == [200, 40, 20]


def test_usd_stands_still_when_it_is_told_to(tmp_path):
    _stage(tmp_path).Save()
    mesh = import_model(tmp_path, "model.usda", "scale: 0.01, forward: +Z, animation: none")
    assert mesh.cycle_seconds == 0.0
    stage = Usd.Stage.Open(str(tmp_path / "assets" / "model.usdc"))
    assert not [a for p in stage.Traverse() for a in p.GetAttributes() if a.GetNumTimeSamples()]


def test_usd_instances_become_meshes(tmp_path):
    stage = Usd.Stage.CreateNew(str(tmp_path / "model.usda"))
    UsdGeom.SetStageUpAxis(stage, "Z")
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    _mesh(stage, "/library/wing")
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/bird").GetPrim())
    for side in (0, 1):
        wing = UsdGeom.Xform.Define(stage, f"/bird/wing_{side}")
        wing.GetPrim().GetReferences().AddInternalReference("/library")
        wing.GetPrim().SetInstanceable(True)
        wing.AddTranslateOp().Set((1000.0 * side, 0, 0))
    stage.GetPrimAtPath("/library").SetSpecifier(Sdf.SpecifierClass)
    stage.Save()
    mesh = import_model(tmp_path, "model.usda", "scale: 0.001, forward: +X")
    assert len(mesh.part_names) == 2
    assert np.ptp(mesh.vertices_at(0.0), axis=0) == pytest.approx([1.1, 0.2, 0])


def _skeletal(folder):
    """A mesh with one joint that turns a quarter and a blend shape with an in-between."""
    stage = Usd.Stage.CreateNew(str(folder / "model.usda"))
    UsdGeom.SetStageUpAxis(stage, "Z")
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetTimeCodesPerSecond(30)
    stage.SetEndTimeCode(30)
    root = UsdSkel.Root.Define(stage, "/bird")
    stage.SetDefaultPrim(root.GetPrim())
    mesh, skeleton = (
        _mesh(stage, "/bird/body", ((0, 0, 0), (1, 0, 0), (0, 2, 0))),
        UsdSkel.Skeleton.Define(stage, "/bird/s"),
    )
    skeleton.CreateJointsAttr(["tip"])
    skeleton.CreateBindTransformsAttr([Gf.Matrix4d(1.0)])
    skeleton.CreateRestTransformsAttr([Gf.Matrix4d(1.0)])
    clip = UsdSkel.Animation.Define(stage, "/bird/s/clip")
    clip.CreateJointsAttr(["tip"])
    clip.CreateTranslationsAttr([(0, 0, 0)])
    clip.CreateScalesAttr([Gf.Vec3h(1, 1, 1)])
    turns = clip.CreateRotationsAttr()
    turns.Set([Gf.Quatf(1, 0, 0, 0)], 0)
    turns.Set([Gf.Quatf(float(np.sqrt(0.5)), 0, 0, float(np.sqrt(0.5)))], 30)
    clip.CreateBlendShapesAttr(["other", "long"])
    weights = clip.CreateBlendShapeWeightsAttr()
    weights.Set([1.0, 0.0], 0)
    weights.Set([1.0, 1.0], 30)
    UsdSkel.BindingAPI.Apply(skeleton.GetPrim()).CreateAnimationSourceRel().SetTargets([clip.GetPath()])
    shape = UsdSkel.BlendShape.Define(stage, "/bird/body/long")
    shape.CreatePointIndicesAttr([1])
    shape.CreateOffsetsAttr([(4, 0, 0)])
    shape.CreateInbetween("half").SetWeight(0.5)
    shape.GetInbetween("half").SetOffsets([(1, 0, 0)])
    binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
    binding.CreateSkeletonRel().SetTargets([skeleton.GetPath()])
    binding.CreateJointIndicesPrimvar(True, 1).Set([0])
    binding.CreateJointWeightsPrimvar(True, 1).Set([1.0])
    binding.CreateBlendShapesAttr(["long"])
    binding.CreateBlendShapeTargetsRel().SetTargets([shape.GetPath()])
    root.CreateExtentAttr([(-9, -9, -9), (9, 9, 9)])
    stage.Save()
    return folder / "model.usda"


@pytest.mark.parametrize("imported", [False, True])
def test_blend_shapes_and_joints_of_users_stages(tmp_path, imported):
    """The shape's weight is remapped from the animation's order; its in-between holds at half of the way."""
    path = _skeletal(tmp_path)
    mesh = import_model(tmp_path, path.name, "scale: 1.0, forward: +X") if imported else load_animated_mesh(path)
    assert mesh.cycle_seconds == pytest.approx(1.0)
    for seconds, length in ((0.0, 1.0), (0.25, 1.5), (0.5, 2.0), (0.75, 3.5)):
        angle = seconds * np.pi / 2
        expected = length * np.array([np.cos(angle), np.sin(angle), 0])
        assert relative(mesh, seconds)[1] == pytest.approx(expected, abs=1e-5)


def test_broken_usd_files_are_named(tmp_path):
    (tmp_path / "model.usda").write_text("nothing")
    with pytest.raises(UserError, match=r"model\.usda is not a readable USD file; export it again"):
        import_model(tmp_path, "model.usda")
    (tmp_path / "model.usda").unlink()
    stage = _stage(tmp_path, "bird.usda")
    stage.Save()
    with pytest.raises(UserError, match="animation is 'flap', but a USD stage has one timeline; use 0 or none"):
        import_model(tmp_path, "bird.usda", "forward: +Z, animation: flap")
    with pytest.raises(UserError, match=r"forward is \+Y, but the stage's up axis is \+Y; correct either"):
        import_model(tmp_path, "bird.usda", "forward: +Y")
    (tmp_path / "skin.png").unlink()
    with pytest.raises(UserError, match=r"the texture .*skin\.png is not there; put it where the material says"):
        import_model(tmp_path, "bird.usda", "forward: +Z")
