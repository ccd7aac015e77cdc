"""Materials bind the texture, and the file shows the pattern."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdShade
from support.painted_assets import PLANE, bilinear

from aerojax.core.colour import linear_from_srgb
from aerojax.simulate.assets.mesh.parts import corner_normals
from aerojax.simulate.assets.paint import patterns
from aerojax.simulate.assets.paint.materials import GLASS_ROUGHNESS
from aerojax.simulate.usd.authoring import write_asset


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    path = tmp_path_factory.mktemp("painted") / "plane.usdc"
    write_asset(path, PLANE, 11)
    return path


def test_materials_bind_the_texture(written):
    stage = Usd.Stage.Open(str(written))
    roughness = {}
    for prim in stage.Traverse():
        if not prim.IsA(UsdGeom.Mesh):
            continue
        material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
        surface = material.ComputeSurfaceSource()[0]
        roughness[prim.GetPath().name if prim.GetName() != "mesh" else "propeller"] = surface.GetInput(
            "roughness"
        ).Get()
        texture = UsdShade.Shader(surface.GetInput("diffuseColor").GetConnectedSources()[0][0].source)
        assert texture.GetIdAttr().Get() == "UsdUVTexture"
        assert texture.GetInput("file").Get().resolvedPath == str(written.with_suffix(".png"))
        st = UsdGeom.PrimvarsAPI(prim).GetPrimvar("st")
        assert st.GetInterpolation() == "faceVarying"
        assert len(st.Get()) == len(UsdGeom.Mesh(prim).GetFaceVertexIndicesAttr().Get())
    assert roughness["canopy"] == pytest.approx(GLASS_ROUGHNESS) and roughness["hull"] > 0.29
    disc = stage.GetPrimAtPath("/plane/disc")
    assert UsdGeom.Mesh(disc).GetDisplayOpacityAttr().Get() == pytest.approx([0.25])
    opacity = UsdShade.MaterialBindingAPI(disc).ComputeBoundMaterial()[0].ComputeSurfaceSource()[0].GetInput("opacity")
    assert opacity.Get() == pytest.approx(0.25)


def test_the_file_shows_the_pattern(written):
    """Texture read through `st` equals the pattern evaluated at the surface; display colours are its means."""
    stage, image = Usd.Stage.Open(str(written)), cv2.imread(str(written.with_suffix(".png")))[..., ::-1] / 255
    prim = stage.GetPrimAtPath("/plane/wings")
    mesh, paint = PLANE.parts[2].mesh, patterns.draw_paint(11)
    st = np.array(UsdGeom.PrimvarsAPI(prim).GetPrimvar("st").Get()).reshape(-1, 3, 2)
    rng = np.random.default_rng(2)
    face, share = rng.integers(0, len(mesh.faces), 3000), rng.dirichlet((1, 1, 1), 3000)
    at = np.einsum("ij,ijk->ik", share, st[face])
    position = np.einsum("ij,ijk->ik", share, mesh.points[mesh.faces[face]])
    normal = corner_normals(mesh).reshape(-1, 3, 3)[face, 0]
    surface = patterns.Surface(position, normal, position[:, 0] / 0.55, np.abs(position[:, 1]) / 0.5)
    fixed = np.concatenate([p.mesh.points for p in PLANE.parts if p.spin is None])
    middle, half = (fixed.min(0) + fixed.max(0))[0] / 2, np.ptp(fixed[:, 0]) / 2
    expected = patterns.colours(paint, 0, replace(surface, along=(position[:, 0] - middle) / half))
    seen = bilinear(image, at[:, 0] * image.shape[1], (1 - at[:, 1]) * image.shape[0])
    assert np.median(np.abs(seen - expected)) < 0.01
    assert np.mean(np.abs(seen - expected)) < 0.03
    display = UsdGeom.Mesh(prim).GetDisplayColorPrimvar().ComputeFlattened()
    means = [linear_from_srgb(seen[face == i]).mean(0) for i in range(len(mesh.faces))]
    large = [i for i in range(len(mesh.faces)) if (face == i).sum() > 30]
    assert np.abs(np.array(display)[large] - np.array(means)[large]).max() < 0.06
