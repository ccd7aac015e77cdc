"""The authored stage of a sequence: poses, cameras, sun, land, and the validators of USD."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from pxr import Gf, Usd, UsdGeom, UsdValidation
from support.usd_examples import define_quad, open_stage, write_solid

from aerojax.simulate.usd.animated_mesh import load_animated_mesh
from aerojax.simulate.usd.scene_stage import StageObject, body_poses, write_landscape_stage, write_scene_stage
from aerojax.simulate.world.landscape import LandscapeConfig, build_landscape
from aerojax.simulate.world.random_rigs import RandomRigConfig, draw_rig


@pytest.fixture(scope="module")
def staged(tmp_path_factory):
    folder = tmp_path_factory.mktemp("stage")
    (folder / "assets").mkdir()
    asset = folder / "assets" / "box.usda"
    write_solid(asset, trimesh.creation.box((1.0, 1.0, 1.0)))
    stage = Usd.Stage.Open(str(asset))
    root = UsdGeom.Xform.Define(stage, "/box")
    Usd.ModelAPI(root).SetKind("component")
    mesh = UsdGeom.Mesh.Define(stage, "/box/mesh")
    mesh.CreatePointsAttr([(0, 0, 0), (1, 0, 0), (0, 1, 0)])
    mesh.CreateFaceVertexCountsAttr([3])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 2])
    mesh.CreateExtentAttr([(0, 0, 0), (1, 1, 0)])
    stage.RemovePrim("/solid")
    stage.SetDefaultPrim(root.GetPrim())
    stage.Save()
    rng = np.random.default_rng(0)
    poses = np.tile(np.eye(4), (2, 3, 1, 1))
    poses[..., :3, 3] = rng.normal(size=(2, 3, 3))
    cameras = draw_rig(RandomRigConfig(cameras=3), np.array([0.0, 0.0, 8.0]), rng)
    land = build_landscape(LandscapeConfig(trees=2, woods=0, hedges=0, buildings=1), np.zeros((1, 2)), seed=1)
    write_landscape_stage(folder / "scenery.usdc", land)
    sun = np.array([(0.0, 0.6, 0.8), (0.0, 0.8, 0.6), (1.0, 0.0, 0.0)])
    path = folder / "a" / "scene.usda"
    path.parent.mkdir()
    objects = [StageObject(asset, p) for p in poses]
    write_scene_stage(path, objects, cameras, fps=30.0, sun=sun, landscape=folder / "scenery.usdc")
    return path, poses, cameras, sun


def test_poses_and_references(staged):
    path, poses, _, _ = staged
    for index in (0, 1):
        np.testing.assert_allclose(body_poses(path, index), poses[index], atol=1e-12)
    stage = Usd.Stage.Open(str(path))
    assert stage.GetPrimAtPath("/World/Object_2/mesh") and stage.GetPrimAtPath("/World/Scenery/Land")
    assert stage.GetEndTimeCode() == 2 and stage.GetTimeCodesPerSecond() == 30


def test_cameras_project_as_the_capture_says(staged):
    path, _, cameras, _ = staged
    stage = Usd.Stage.Open(str(path))
    for camera in cameras:
        frustum = UsdGeom.Camera(stage.GetPrimAtPath(f"/World/{camera.name}")).GetCamera(0).frustum
        point = np.array([0.3, -0.2, 8.1])
        seen = (frustum.ComputeViewMatrix() * frustum.ComputeProjectionMatrix()).Transform(Gf.Vec3d(*point))
        local = camera.world_from_cam[:3, :3].T @ (point - camera.world_from_cam[:3, 3])
        u, v = (camera.K @ (local / local[2]))[:2]
        assert (0.5 + 0.5 * seen[0]) * camera.width == pytest.approx(u, abs=1e-2)
        assert (0.5 - 0.5 * seen[1]) * camera.height == pytest.approx(v, abs=1e-2)


def test_the_sun_shines_from_where_it_is(staged):
    path, _, _, sun = staged
    stage = Usd.Stage.Open(str(path))
    for frame, direction in enumerate(sun):
        matrix = UsdGeom.Xformable(stage.GetPrimAtPath("/World/Sun")).ComputeLocalToWorldTransform(frame)
        assert np.array(matrix.TransformDir(Gf.Vec3d(0, 0, 1))) == pytest.approx(direction, abs=1e-9)


def test_usd_finds_nothing_to_complain_about(staged):
    registry = UsdValidation.ValidationRegistry()
    names = [m.name for m in registry.GetAllValidatorMetadata()]
    context = UsdValidation.ValidationContext(registry.GetOrLoadValidatorsByName(names))
    errors = context.Validate(Usd.Stage.Open(str(staged[0])))
    assert names
    assert [(e.GetName(), e.GetMessage()) for e in errors] == []


def test_animation_starts_at_its_phase(tmp_path):
    asset = tmp_path / "turning.usda"
    stage = open_stage(asset)
    stage.SetTimeCodesPerSecond(120)
    stage.SetEndTimeCode(240)
    root = UsdGeom.Xform.Define(stage, "/turning")
    stage.SetDefaultPrim(root.GetPrim())
    turn = define_quad(stage, "/turning/rotor").AddRotateZOp()
    turn.Set(0.0, 0)
    turn.Set(360.0, 240)
    stage.Save()
    poses = np.tile(np.eye(4), (3, 1, 1))
    write_scene_stage(tmp_path / "scene.usda", [StageObject(asset, poses, 6.5)], (), fps=30.0)
    scene = Usd.Stage.Open(str(tmp_path / "scene.usda"))
    rotor = UsdGeom.Xformable(scene.GetPrimAtPath("/World/Object/rotor"))
    mesh = load_animated_mesh(asset)
    for frame in range(3):
        staged = np.array(rotor.ComputeLocalToWorldTransform(frame)).T
        np.testing.assert_allclose(staged, mesh.joints_at(6.5 + frame / 30.0)["rotor"], atol=1e-9)
