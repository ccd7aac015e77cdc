"""Loading foreign stages: units, axes, polygons, colours, orientation, point samples and mistakes."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Usd, UsdGeom

from aerojax.core.errors import UserError
from aerojax.simulate.usd.animated_mesh import load_animated_mesh

QUAD = [(0, 0, 0), (100, 0, 0), (100, 100, 0), (0, 100, 0)]


def _stage(path, axis="Y", metres=0.01):
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, axis)
    UsdGeom.SetStageMetersPerUnit(stage, metres)
    return stage


def _quad(stage, name="/quad"):
    mesh = UsdGeom.Mesh.Define(stage, name)
    mesh.CreatePointsAttr(QUAD)
    mesh.CreateFaceVertexCountsAttr([4])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 2, 3])
    return mesh


def test_centimetres_and_y_up_become_metres_and_z_up(tmp_path):
    stage = _stage(tmp_path / "a.usda")
    _quad(stage)
    stage.Save()
    mesh = load_animated_mesh(tmp_path / "a.usda")
    assert mesh.vertices_at(0.0) == pytest.approx(np.array([[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]]), abs=1e-6)
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert mesh.cycle_seconds == 0.0
    assert mesh.albedo == pytest.approx(0.5)


def test_left_handed_faces_are_turned(tmp_path):
    stage = _stage(tmp_path / "a.usda", "Z", 1.0)
    _quad(stage).CreateOrientationAttr("leftHanded")
    stage.Save()
    assert load_animated_mesh(tmp_path / "a.usda").faces.tolist() == [[2, 1, 0], [3, 2, 0]]


@pytest.mark.parametrize(
    ("interpolation", "values", "linear"),
    [
        ("constant", [(0.2, 0.2, 0.2)], [0.2, 0.2, 0.5, 0.5]),
        ("uniform", [(0.2, 0.2, 0.2)], [0.2, 0.2, 0.5, 0.5]),
        ("vertex", [(v, v, v) for v in (0.1, 0.2, 0.3, 0.5)], [0.2, 0.3, 0.5, 0.5]),
        ("faceVarying", [(v, v, v) for v in (0.1, 0.2, 0.3, 0.4)], [0.25, 0.25, 0.5, 0.5]),
    ],
)
def test_colour_interpolations(tmp_path, interpolation, values, linear):
    stage = _stage(tmp_path / "a.usda", "Z", 1.0)
    _quad(stage).CreateDisplayColorPrimvar(interpolation).Set(values)
    _quad(stage, "/zz_grey")
    stage.Save()
    mesh = load_animated_mesh(tmp_path / "a.usda")
    srgb = 1.055 * np.array(linear[:2]) ** (1 / 2.4) - 0.055
    assert mesh.albedo[:2, 0] == pytest.approx(srgb, abs=1e-6)
    assert mesh.albedo[2:] == pytest.approx(0.5)
    assert mesh.part.tolist() == [0, 0, 1, 1] and mesh.part_names == ("/quad", "/zz_grey")


def test_point_samples_and_moving_parents(tmp_path):
    stage = _stage(tmp_path / "a.usda", "Z", 1.0)
    stage.SetTimeCodesPerSecond(10)
    stage.SetStartTimeCode(5)
    stage.SetEndTimeCode(15)
    parent = UsdGeom.Xform.Define(stage, "/parent")
    shift = parent.AddTranslateOp()
    shift.Set((0, 0, 0), 5)
    shift.Set((10, 0, 0), 15)
    mesh = _quad(stage, "/parent/quad")
    mesh.GetPointsAttr().Set(QUAD, 5)
    mesh.GetPointsAttr().Set([(x, y, 8) for x, y, _ in QUAD], 15)
    stage.Save()
    loaded = load_animated_mesh(tmp_path / "a.usda")
    assert loaded.cycle_seconds == 1.0
    assert loaded.vertices_at(0.5)[0] == pytest.approx([5.0, 0.0, 4.0])
    assert loaded.vertices_at(1.5)[0] == pytest.approx([5.0, 0.0, 4.0])


def test_invisible_meshes_are_left_out(tmp_path):
    stage = _stage(tmp_path / "a.usda", "Z", 1.0)
    _quad(stage)
    UsdGeom.Imageable(_quad(stage, "/hidden")).MakeInvisible()
    stage.Save()
    assert load_animated_mesh(tmp_path / "a.usda").part_names == ("/quad",)


def test_mistakes_are_named(tmp_path):
    with pytest.raises(UserError, match="does not exist"):
        load_animated_mesh(tmp_path / "none.usdc")
    (tmp_path / "broken.usda").write_text("not a stage")
    with pytest.raises(UserError, match=r"broken\.usda is not a readable USD file"):
        load_animated_mesh(tmp_path / "broken.usda")
    _stage(tmp_path / "empty.usda").Save()
    with pytest.raises(UserError, match="no visible UsdGeomMesh"):
        load_animated_mesh(tmp_path / "empty.usda")
