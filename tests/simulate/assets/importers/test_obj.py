"""Wavefront files by hand-computed numbers, and their mistakes."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from pxr import Usd, UsdShade
from support.model_imports import AXES, IMAGE, import_model, shown

from aerojax.core.errors import UserError

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
    assert cv2.imwrite(str(folder / "skin.png"), IMAGE[..., ::-1])


def test_obj_polygons_textures_and_materials(tmp_path):
    _obj(tmp_path)
    mesh = import_model(tmp_path, "model.obj")
    assert np.ptp(mesh.vertices_at(0.0), axis=0) == pytest.approx([4, 2, 0])
    assert len(mesh.faces) == 3 and mesh.texture.tolist() == [0, 0, -1]
    assert shown(mesh) == [200, 40, 20]
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
        import_model(tmp_path, "model.obj")


def test_obj_has_no_clips(tmp_path):
    _obj(tmp_path)
    with pytest.raises(UserError, match="animation is 0, but OBJ files hold no animation; use none"):
        import_model(tmp_path, "model.obj", AXES + ", animation: 0")
