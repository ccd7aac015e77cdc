"""Materials of USD meshes: textures beside a stage and inside a usdz, constants, subsets, and mistakes."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Sdf, UsdGeom, UsdShade, UsdUtils
from support.usd_examples import define_quad, define_textured_material, open_stage, write_picture

from aerojax.core.errors import UserError
from aerojax.simulate.usd.animated_mesh import load_animated_mesh

PICTURE = np.random.default_rng(0).integers(0, 256, (4, 8, 3), dtype=np.uint8)


@pytest.fixture
def textured(tmp_path):
    write_picture(tmp_path / "skin.png", PICTURE)
    stage = open_stage(tmp_path / "a.usda")
    quad = define_quad(stage, "/quad")
    material = define_textured_material(stage, "/look", "./skin.png")
    UsdShade.MaterialBindingAPI.Apply(quad.GetPrim()).Bind(material)
    return stage, tmp_path


def test_a_texture_beside_the_stage(textured):
    stage, folder = textured
    stage.Save()
    mesh = load_animated_mesh(folder / "a.usda")
    np.testing.assert_array_equal(mesh.textures[0], PICTURE)
    assert mesh.texture.tolist() == [0, 0] and mesh.albedo == pytest.approx(1.0)
    assert mesh.uv.tolist() == [[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]]


def test_a_texture_inside_a_package(textured):
    stage, folder = textured
    stage.SetDefaultPrim(stage.GetPrimAtPath("/quad"))
    stage.Save()
    assert UsdUtils.CreateNewUsdzPackage(str(folder / "a.usda"), str(folder / "a.usdz"))
    (folder / "skin.png").unlink()
    np.testing.assert_array_equal(load_animated_mesh(folder / "a.usdz").textures[0], PICTURE)


def test_subsets_bind_their_own_materials(textured):
    stage, folder = textured
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/quad"))
    mesh.GetFaceVertexCountsAttr().Set([3, 3])
    mesh.GetFaceVertexIndicesAttr().Set([0, 1, 2, 0, 2, 3])
    UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st").Set([(0, 0), (1, 0), (1, 1), (0, 0), (1, 1), (0, 1)])
    plain = UsdShade.Material.Define(stage, "/plain")
    surface = UsdShade.Shader.Define(stage, "/plain/surface")
    surface.CreateIdAttr("UsdPreviewSurface")
    surface.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set((0.2, 0.2, 0.2))
    plain.CreateSurfaceOutput().ConnectToSource(surface.ConnectableAPI(), "surface")
    subset = UsdGeom.Subset.CreateGeomSubset(mesh, "part", "face", [1], "materialBind")
    UsdShade.MaterialBindingAPI.Apply(subset.GetPrim()).Bind(plain)
    stage.Save()
    loaded = load_animated_mesh(folder / "a.usda")
    assert loaded.texture.tolist() == [0, -1]
    assert loaded.albedo[1] == pytest.approx(1.055 * 0.2 ** (1 / 2.4) - 0.055, abs=1e-6)


def test_mistakes_are_named(textured):
    stage, folder = textured
    stage.Save()
    (folder / "skin.png").write_bytes(b"no picture")
    with pytest.raises(UserError, match=r"skin\.png is not a readable"):
        load_animated_mesh(folder / "a.usda")
    (folder / "skin.png").unlink()
    with pytest.raises(UserError, match=r"/quad: its texture '\./skin\.png' is not there"):
        load_animated_mesh(folder / "a.usda")
    write_picture(folder / "skin.png", PICTURE)
    stage.GetPrimAtPath("/quad").RemoveProperty("primvars:st")
    stage.Save()
    with pytest.raises(UserError, match="needs the primvar 'st'"):
        load_animated_mesh(folder / "a.usda")
