"""STL and PLY meshes by their areas and colours, and damaged ones."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from support.model_imports import import_model

from aerojax.core.errors import UserError

PLY = """ply
format ascii 1.0
element vertex 6
property float x
property float y
property float z
property uchar red
property uchar green
property uchar blue
element face FACES
property list uchar int vertex_indices
end_header
0 0 0 255 0 0
2 0 0 255 0 0
2 1 0 255 0 0
1 1 0 255 0 0
1 2 0 255 0 0
0 2 0 255 0 0
"""


def _area(mesh):
    a, b, c = np.moveaxis(mesh.vertices_at(0.0)[mesh.faces], 1, 0)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


@pytest.mark.parametrize("kind", ["stl", "stl_ascii", "ply"])
def test_boxes_of_trimesh(tmp_path, kind):
    path = tmp_path / f"model.{kind[:3]}"
    data = trimesh.creation.box((2.0, 1.0, 0.5)).export(file_type=kind)
    path.write_bytes(data.encode() if isinstance(data, str) else data)
    mesh = import_model(tmp_path, path.name)
    assert len(mesh.faces) == 12 and _area(mesh) == pytest.approx(7.0)
    assert np.ptp(mesh.vertices_at(0.0), axis=0) == pytest.approx([2, 1, 0.5])


@pytest.mark.parametrize(
    ("faces", "area"), [("6 1 2 3 4 5 0\n", 3.0), ("6 1 2 3 4 5 0\n3 0 1 2\n", 4.0), ("3 0 1 2\n4 0 1 3 5\n", 3.0)]
)
def test_concave_faces_of_ply_keep_their_area_and_colours(tmp_path, faces, area):
    (tmp_path / "model.ply").write_text(PLY.replace("FACES", str(faces.count("\n"))) + faces)
    mesh = import_model(tmp_path, "model.ply")
    assert _area(mesh) == pytest.approx(area)
    assert mesh.albedo == pytest.approx(np.tile([1.0, 0, 0], (len(mesh.faces), 1)), abs=1e-6)


BOX = trimesh.creation.box().export(file_type="stl")


@pytest.mark.parametrize(
    ("name", "data", "message"),
    [
        ("a.stl", BOX[:-7], "its 12 facets are not in the file; export it again"),
        ("a.stl", BOX[:80] + b"\xff" * 4 + BOX[84:], "its 4294967295 facets are not in the file"),
        ("a.stl", b"", "its 0 facets are not in the file"),
        ("a.ply", b"nothing", "cannot be read as PLY"),
        ("a.ply", PLY.replace("vertex 6", "vertex 900000000").replace("FACES", "0").encode(), "holds no faces"),
        ("a.ply", PLY.replace("FACES", "0").encode(), "holds no faces; export the model as a mesh"),
        ("a.ply", (PLY.replace("FACES", "1") + "3 0 1 9\n").encode(), "cannot be read as PLY"),
        ("a.ply", (PLY.replace("FACES", "2") + "3 0 1 2\n").encode(), "cannot be read as PLY"),
    ],
)
def test_damaged_meshes_are_named(tmp_path, name, data, message):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(UserError, match=message) as caught:
        import_model(tmp_path, name)
    assert str(tmp_path / name) in caught.value.problem


def test_faces_without_corners_are_none(tmp_path):
    path = tmp_path / "model.ply"
    text = PLY.replace("FACES", "1").replace(" 255 0 0", "")
    text = "".join(line for line in text.splitlines(True) if "uchar " not in line or "list" in line)
    path.write_text(text + "0\n")
    with pytest.raises(UserError, match="holds no faces"):
        import_model(tmp_path, "model.ply")
