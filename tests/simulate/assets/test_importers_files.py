"""The list of a user's models with all its mistakes, OBJ files, and users' own USD stages."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade, UsdSkel, UsdUtils, UsdValidation
from support.gltf_files import triangle

from aerojax.core.errors import UserError
from aerojax.simulate.assets.catalogue import SPLITS, build_identity
from aerojax.simulate.assets.importers.identities import imported_identities
from aerojax.simulate.assets.importers.models import read_models
from aerojax.simulate.usd.animated_mesh import load_animated_mesh

PICTURE = np.zeros((2, 4, 3), np.uint8)
PICTURE[0], PICTURE[1] = (200, 40, 20), (10, 60, 220)  # RGB of the upper and the lower half
AXES = "scale: 1.0, forward: +X, up: +Z"


def _import(folder, file, fields=AXES, label="bird"):
    """Convert one model and load the stage, which must be valid."""
    path = folder / "models.yaml"
    path.write_text(f"models:\n  - {{name: model, file: {file}, class: {label}, {fields}}}\n")
    stage = build_identity(imported_identities(path)[0], folder / "assets")
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    errors = UsdValidation.ValidationContext(validators).Validate(Usd.Stage.Open(str(stage)))
    assert [e.GetMessage() for e in errors] == []
    return load_animated_mesh(stage)


def _relative(mesh, seconds):
    vertices = mesh.vertices_at(seconds)
    return vertices - vertices[0]


def _shown(mesh, face=0):
    """The texel in the middle of a face."""
    u, v = mesh.uv[face].mean(axis=0)
    picture = mesh.textures[mesh.texture[face]]
    return picture[int((1 - v) % 1 * picture.shape[0]), int(u % 1 * picture.shape[1])].tolist()


# The list


def _read(folder, text):
    path = folder / "models.yaml"
    path.write_text(text)
    return read_models(path)


def test_every_mistake_of_a_list_is_named_at_once(tmp_path):
    triangle().write(tmp_path / "a.glb")
    (tmp_path / "a.obj").write_text("")
    text = """
models:
  - {name: 1st, file: a.glb, class: plane, split: all, forward: up, scale: big, speed: 0, animation: -1, colour: red}
  - {file: missing.glb, class: bird, name: twice}
  - {name: twice, file: a.obj, class: bird}
  - {name: c, file: a.fbx, class: bird, up: +Y, forward: -Y}
  - {name: d, file: a.glb, class: bird, up: 3, scale: true, speed: fast, animation: [1]}
  - just words
  - {name: e, file: a.glb, class: bird, up: +Z}
  - {}
"""
    with pytest.raises(UserError) as caught:
        _read(tmp_path, text)
    expected = [
        "models.yaml does not fit a list of models",
        "models[0] (1st): unknown field(s) colour; use name, file, class",
        "models[0] (1st): name: '1st' is no file and prim name; use letters",
        "models[0] (1st): class: 'plane' is unknown; use bird, drone, airplane, helicopter",
        "models[0] (1st): split: 'all' is unknown; use train, val, test",
        "models[0] (1st): forward: 'up' is no axis; use +X, +Y",
        "models[0] (1st): scale: 'big' is neither auto nor a positive number; give metres per unit",
        "models[0] (1st): speed: 0 must be a positive number",
        "models[0] (1st): animation: -1 must not be negative; count clips from 0",
        f"models[1] (twice): file: {tmp_path / 'missing.glb'} does not exist; give it relative to models.yaml",
        "models[2] (twice): forward: is missing, and .obj has no convention",
        "models[2] (twice): up: is missing, and .obj has no convention",
        "models[3] (c): up: +Y lies along forward (-Y); the two must be perpendicular",
        "models[3] (c): file: a.fbx has no known ending; use .glb, .gltf, .obj, .usd",
        "models[4] (d): up: expected str, got 3",
        "models[4] (d): scale: expected int or float or str, got True",
        "models[4] (d): speed: expected int or float, got 'fast'",
        "models[4] (d): animation: expected int or str or nothing, got [1]",
        "models[5]: expected fields, got 'just words'",
        "models[6] (e): forward: +Z and up: +Z lie along one line; give both",
        "models[7]: name: required field is missing",
        "models[7]: file: required field is missing",
        "models[7]: class: required field is missing",
        "name 'twice' is given to several models",
    ]
    assert [line for line in expected if line not in str(caught.value)] == []
    assert len(str(caught.value).splitlines()) == len(expected)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("models: [", "is not readable YAML"),
        ("- name: a", "holds no list `models:`"),
        ("models: {}\n", "holds no list `models:`"),
        ("models: []\nextra: 1\n", "or more than it"),
    ],
)
def test_files_that_are_no_list(tmp_path, text, message):
    with pytest.raises(UserError, match=message):
        _read(tmp_path, text)


def test_missing_list_and_missing_model(tmp_path):
    with pytest.raises(UserError, match=r"list of models .* does not exist"):
        read_models(tmp_path / "none.yaml")
    triangle().write(tmp_path / "a.glb")
    (tmp_path / "models.yaml").write_text("models:\n  - {name: a, file: a.glb, class: bird}\n")
    identity = imported_identities(tmp_path / "models.yaml")[0]
    (tmp_path / "a.glb").unlink()
    with pytest.raises(UserError, match=r"model a: file .* does not exist; correct the list"):
        build_identity(identity, tmp_path)


def test_names_of_the_catalogue_are_refused(tmp_path):
    triangle().write(tmp_path / "a.glb")
    name = f"bird_{SPLITS['bird']['train'][0]}_00"
    (tmp_path / "models.yaml").write_text(f"models:\n  - {{name: {name}, file: a.glb, class: bird}}\n")
    with pytest.raises(UserError, match=f"name {name} belongs to the procedural catalogue"):
        imported_identities(tmp_path / "models.yaml")


def test_drone_without_motors_needs_a_scale(tmp_path):
    triangle().write(tmp_path / "a.glb")
    with pytest.raises(
        UserError, match=r"a\.glb: scale: auto does not find the distance between its motors; give scale"
    ):
        _import(tmp_path, "a.glb", "scale: auto", label="drone")


# OBJ

OBJ = """
mtllib model.mtl
o body
v 0 0 0
v 4 0 0
v 4 2 0
v 0 2 0
vt 0 0.6
vt 1 0.6
vt 1 1
vt 0 1
usemtl paint
f 1/1 2/2 3/3 4/4
o rotor_front
usemtl red
f -4 -3 -2
l 1 2
"""
MTL = "newmtl paint\nKd 1 1 1\nmap_Kd skin.png\nNs 30\nnewmtl red\nKd 0.5 0 0\nd 0.5\nPr 0.25\nPm 1\n"


def _obj(folder, obj=OBJ, mtl=MTL):
    (folder / "model.obj").write_text(obj)
    (folder / "model.mtl").write_text(mtl)
    assert cv2.imwrite(str(folder / "skin.png"), PICTURE[..., ::-1])


def test_obj_polygons_textures_and_materials(tmp_path):
    _obj(tmp_path)
    mesh = _import(tmp_path, "model.obj")
    assert np.ptp(mesh.vertices_at(0.0), axis=0) == pytest.approx([4, 2, 0])
    assert len(mesh.faces) == 3 and mesh.texture.tolist() == [0, 0, -1]
    assert _shown(mesh) == [200, 40, 20]
    assert mesh.albedo[2] == pytest.approx([1.055 * 0.5 ** (1 / 2.4) - 0.055, 0, 0], abs=1e-6)
    assert [path.split("/")[-2] for path in mesh.part_names] == ["body", "rotor_front"]
    normals = np.cross(
        *(mesh.vertices_at(0.0)[mesh.faces[:, k]] - mesh.vertices_at(0.0)[mesh.faces[:, 0]] for k in (1, 2))
    )
    assert (normals[:, 2] > 0).all()
    stage = Usd.Stage.Open(str(tmp_path / "assets" / "model.usdc"))
    shaders = [UsdShade.Shader(p) for p in stage.Traverse() if p.IsA(UsdShade.Shader)]
    surfaces = [s for s in shaders if s.GetIdAttr().Get() == "UsdPreviewSurface"]
    found = sorted((s.GetInput("roughness").Get(), s.GetInput("metallic").Get()) for s in surfaces)
    assert found == [(0.25, 1.0), (0.5, 0.0)]  # (2 / 32) ** 0.25


def test_static_drone_is_measured_between_named_rotors(tmp_path):
    corners = [(x, y) for x in (-3, 3) for y in (-4, 4)]
    rows = [
        f"o rotor_{i}\nv {x} {y} 0\nv {x + 1} {y} 0\nv {x} {y + 1} 0\nf -3 -2 -1\n" for i, (x, y) in enumerate(corners)
    ]
    (tmp_path / "model.obj").write_text("".join(rows))
    mesh = _import(tmp_path, "model.obj", "forward: +X, up: +Z", label="drone")
    assert np.ptp(mesh.vertices_at(0.0), axis=0) == pytest.approx([0.7, 0.9, 0])


@pytest.mark.parametrize(
    ("obj", "mtl", "message"),
    [
        ("v 0 0 0\nf 1 2 3\n", "", r"line 2 is not understood \('f 1 2 3'\)"),
        ("v 0 zero 0\n", "", "line 1 is not understood"),
        ("v 0 0 0\n", "", "holds no faces; export the model as a mesh"),
        ("mtllib other.mtl\n", "", "its material library other.mtl is missing"),
        (OBJ, "newmtl paint\nmap_Kd none.png\n", "map_Kd names none.png, which is missing"),
    ],
)
def test_broken_obj_files_are_named(tmp_path, obj, mtl, message):
    _obj(tmp_path, obj, mtl)
    with pytest.raises(UserError, match=message):
        _import(tmp_path, "model.obj")


def test_obj_has_no_clips(tmp_path):
    _obj(tmp_path)
    with pytest.raises(UserError, match="animation is 0, but OBJ files hold no animation; use none"):
        _import(tmp_path, "model.obj", AXES + ", animation: 0")


# USD


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
    assert cv2.imwrite(str(folder / "skin.png"), PICTURE[..., ::-1])
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
    mesh = _import(tmp_path, "model.usda", "scale: 0.01, forward: +Z, speed: 2.0")
    assert mesh.cycle_seconds == pytest.approx(0.5)
    assert _relative(mesh, 0.0)[:3] == pytest.approx(np.array([[0, 0, 0], [0, 1, 0], [0, 0, 2]]), abs=1e-6)
    assert _relative(mesh, 0.25)[3] == pytest.approx([1.2, 0, 0], abs=1e-6)
    assert _relative(mesh, 0.375)[3] == pytest.approx([1.8, 0, 0], abs=1e-6)
    assert _shown(mesh) == [200, 40, 20]
    stage = Usd.Stage.Open(str(tmp_path / "assets" / "model.usdc"))
    assert not [p for p in stage.Traverse() if p.IsA(UsdGeom.Camera) or p.HasAPI(UsdLux.LightAPI)]


def test_usdz_brings_its_pictures(tmp_path):
    _stage(tmp_path).Save()
    assert UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(str(tmp_path / "model.usda")), str(tmp_path / "model.usdz"))
    (tmp_path / "skin.png").unlink()
    assert _shown(_import(tmp_path, "model.usdz", "scale: 0.01, forward: +Z")) == [200, 40, 20]


def test_usd_stands_still_when_it_is_told_to(tmp_path):
    _stage(tmp_path).Save()
    mesh = _import(tmp_path, "model.usda", "scale: 0.01, forward: +Z, animation: none")
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
    mesh = _import(tmp_path, "model.usda", "scale: 0.001, forward: +X")
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
    mesh = _import(tmp_path, path.name, "scale: 1.0, forward: +X") if imported else load_animated_mesh(path)
    assert mesh.cycle_seconds == pytest.approx(1.0)
    for seconds, length in ((0.0, 1.0), (0.25, 1.5), (0.5, 2.0), (0.75, 3.5)):
        angle = seconds * np.pi / 2
        expected = length * np.array([np.cos(angle), np.sin(angle), 0])
        assert _relative(mesh, seconds)[1] == pytest.approx(expected, abs=1e-5)


def test_broken_usd_files_are_named(tmp_path):
    (tmp_path / "model.usda").write_text("nothing")
    with pytest.raises(UserError, match=r"model\.usda is not a readable USD file; export it again"):
        _import(tmp_path, "model.usda")
    (tmp_path / "model.usda").unlink()
    stage = _stage(tmp_path, "bird.usda")
    stage.Save()
    with pytest.raises(UserError, match="animation is 'flap', but a USD stage has one timeline; use 0 or none"):
        _import(tmp_path, "bird.usda", "forward: +Z, animation: flap")
    with pytest.raises(UserError, match=r"forward is \+Y, but the stage's up axis is \+Y; correct either"):
        _import(tmp_path, "bird.usda", "forward: +Y")
    (tmp_path / "skin.png").unlink()
    with pytest.raises(UserError, match=r"the texture .*skin\.png is not there; put it where the material says"):
        _import(tmp_path, "bird.usda", "forward: +Z")
