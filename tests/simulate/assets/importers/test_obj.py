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


FACE = "v 0 0 0\nv 4 0 0\nv 0 2 0\nvt 0 0.6\nvt 1 0.6\nvt 0 1\n"


def _area(mesh):
    a, b, c = np.moveaxis(mesh.vertices_at(0.0)[mesh.faces], 1, 0)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


@pytest.mark.parametrize(
    "obj",
    [
        b"\xef\xbb\xbf" + FACE.encode() + b"f 1 2 3\n",
        FACE.replace(" ", "\t").encode() + b"f\t1  2\t3\r\n",
        FACE.replace("\n", "\r\n").encode() + b"f 1 2 \\\r\n 3",
        FACE.replace("\n", " # about it\n").encode() + b"f -3 -2 -1 # all\nf 1 2\n",
        (FACE + "f 1/1 2/2 3/3\n").encode("utf-16"),
        FACE.encode() + b"vn nan 0 1\nf 1//1 2//1 3//1 \\",
        FACE.encode() + b"g r\xf6tor\no \x0c\x85\nf 1 2 3\n",
    ],
)
def test_ways_of_writing_one_triangle(tmp_path, obj):
    (tmp_path / "model.obj").write_bytes(obj)
    mesh = import_model(tmp_path, "model.obj")
    assert len(mesh.faces) == 1 and _area(mesh) == pytest.approx(4.0)


@pytest.mark.parametrize(
    ("outline", "area"),
    [([0, 0, 2, 0, 2, 1, 1, 1, 1, 2, 0, 2], 3.0), ([0, 0, 3, 0, 3, 2, 2, 2, 2, 1, 1, 1, 1, 2, 0, 2], 5.0)],
)
def test_concave_faces_keep_their_area(tmp_path, outline, area):
    places = np.reshape(outline, (-1, 2)).tolist()
    for first in range(len(places)):
        turned = places[first:] + places[:first]
        lines = [f"v {x} {y} 0" for x, y in turned] + ["f " + " ".join(map(str, range(1, len(turned) + 1)))]
        (tmp_path / "model.obj").write_text("\n".join(lines))
        assert _area(import_model(tmp_path, "model.obj")) == pytest.approx(area)


@pytest.mark.parametrize(
    ("library", "picture", "mtllib", "named"),
    [
        ("my paints.mtl", "my skin.png", "my paints.mtl", "my skin.png"),
        ("my paints.mtl", "my skin.png", '"my paints.mtl"', '"my skin.png"'),
        ("a.mtl", "skin.png", "a.mtl", "-clamp on -s 1 1 1 -o 0 0 skin.png"),
        ("a.mtl", "2.png", "a.mtl", "-s 1 2.png"),
        ("a.mtl", "skin.png", "a.mtl", "C:\\Users\\me\\pictures\\Skin.PNG"),
        ("a.mtl", "tex/skin.png", "a.mtl", "tex\\skin.png"),
        ("Flügel.mtl", "flügel.png", "Flügel.mtl", "flügel.png"),
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "cp1252"])
def test_names_of_libraries_and_pictures(tmp_path, library, picture, mtllib, named, encoding):
    (tmp_path / "tex").mkdir()
    assert cv2.imwrite(str(tmp_path / picture), IMAGE[..., ::-1])
    (tmp_path / library).write_bytes(f"newmtl red paint\nmap_Kd {named}\n".encode(encoding))
    (tmp_path / "model.obj").write_bytes(f"mtllib\t{mtllib}\n{FACE}usemtl\tred paint\nf 1/1 2/2 3/3\n".encode(encoding))
    assert shown(import_model(tmp_path, "model.obj")) == [200, 40, 20]


def test_several_libraries_and_moved_textures(tmp_path):
    """Coordinates are scaled, then moved: the lower half of the picture is shown."""
    _obj(
        tmp_path,
        f"mtllib other.mtl model.mtl\n{FACE}usemtl a\nf 1/1 2/2 3/3\n",
        "newmtl a\nmap_Kd -o 0 -0.5 skin.png\n",
    )
    (tmp_path / "other.mtl").write_text("newmtl b\nKd 0.5\n")
    assert shown(import_model(tmp_path, "model.obj")) == [10, 60, 220]


@pytest.mark.parametrize("whole", [1, 255])
def test_vertices_without_a_colour_are_white_beside_those_with_one(tmp_path, whole):
    """The face shows the mean of its corners in linear light: one red, two white."""
    (tmp_path / "model.obj").write_text(FACE.replace("v 0 0 0\n", f"v 0 0 0 {whole} 0 0\n") + "f 1 2 3\n")
    linear = 2 / 3
    pale = 1.055 * linear ** (1 / 2.4) - 0.055
    assert import_model(tmp_path, "model.obj").albedo[0] == pytest.approx([1, pale, pale], abs=1e-6)


@pytest.mark.parametrize(
    ("obj", "mtl", "message"),
    [
        ("v nan 0 0\n", "", r"model\.obj: line 1 is not understood \('v nan 0 0'\)"),
        ("v 0 0 0\nv 0 inf 0\n", "", "line 2 is not understood"),
        ("v 0 0 \\\n 0\nv 1 0\n", "", r"line 3 is not understood \('v 1 0'\)"),
        (FACE + "f 0 1 2\n", "", r"line 7 is not understood \('f 0 1 2'\)"),
        (FACE + "f -4 1 2\n", "", "line 7 is not understood"),
        (FACE + "f /1 /2 /3\n", "", "line 7 is not understood"),
        ("mtllib a.mtl model.mtl\n", "", "its material library a.mtl is missing; keep it beside the model"),
        ("mtllib model.mtl\n", "newmtl a\nKd 1 x 1\n", r"model\.mtl: line 2 is not understood \('Kd 1 x 1'\)"),
        ("mtllib model.mtl\n", "newmtl a\nmap_Kd\n", "map_Kd names , which is missing"),
        ("mtllib model.mtl\n", f"newmtl a\nmap_Kd {'x' * 5000}\n", "which is missing"),
    ],
)
def test_more_broken_obj_files_are_named(tmp_path, obj, mtl, message):
    _obj(tmp_path, obj, mtl)
    with pytest.raises(UserError, match=message):
        import_model(tmp_path, "model.obj")
