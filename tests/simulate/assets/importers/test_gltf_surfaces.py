"""Primitives of glTF files: what is left out, read in other ways, or refused."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from support.gltf_files import triangle
from support.model_imports import IMAGE, import_model, shown, textured

from aerojax.core.errors import UserError


def test_primitives_without_vertices_or_faces_are_left_out(tmp_path):
    glb = triangle()
    nothing = glb.entry({"bufferView": 0, "count": 0, "componentType": 5126, "type": "VEC3"})
    whole = glb.tree["meshes"][0]["primitives"][0]
    few = {**whole, "indices": glb.add([0, 1], "uint8")}
    points = {**whole, "mode": 0}
    glb.tree["meshes"][0]["primitives"] = [
        {"attributes": {"POSITION": nothing}},
        few,
        points,
        {"attributes": {}},
        whole,
    ]
    mesh = import_model(tmp_path, glb.write(tmp_path / "a.glb"))
    assert mesh.faces.tolist() == [[0, 1, 2]] and len(mesh.part_names) == 1


def test_interleaved_attributes_and_normals_that_are_none(tmp_path):
    """Positions and normals in one view, 24 bytes a vertex; a normal that is no number becomes the face's."""
    glb = triangle()
    rows = np.array([[0, 0, 0, np.nan, 0, 0], [2, 0, 0, 0, 0, 1], [0, 1, 0, 0, 0, 1]], np.float32)
    view = glb.view(rows.tobytes(), byteStride=24)
    fields = {"bufferView": view, "count": 3, "componentType": 5126, "type": "VEC3"}
    attributes = {"POSITION": glb.entry(fields), "NORMAL": glb.entry({**fields, "byteOffset": 12})}
    glb.tree["meshes"][0]["primitives"][0]["attributes"] = attributes
    mesh = import_model(tmp_path, glb.write(tmp_path / "a.glb"))
    assert np.ptp(mesh.vertices_at(0.0), axis=0) == pytest.approx([2, 1, 0])


def test_specular_glossiness_and_webp(tmp_path):
    glb = textured(triangle())
    encoded = cv2.imencode(".webp", np.kron(IMAGE[..., ::-1], np.ones((16, 16, 1), np.uint8)))[1].tobytes()
    glb.tree["images"] = [{"uri": "nowhere.png"}, {"bufferView": glb.view(encoded), "mimeType": "image/webp"}]
    glb.tree["textures"] = [{"extensions": {"EXT_texture_webp": {"source": 1}}}]
    surface = glb.tree["materials"][0].pop("pbrMetallicRoughness")
    glossy = {"diffuseTexture": surface["baseColorTexture"]}
    glb.tree["materials"][0]["extensions"] = {"KHR_materials_pbrSpecularGlossiness": glossy}
    assert shown(import_model(tmp_path, glb.write(tmp_path / "a.glb"))) == pytest.approx([200, 40, 20], abs=4)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda g, p: p.update(indices=g.add([0, 1, 3], "uint8")), r"primitives\[0\]\.indices names vertex 3 of 3"),
        (lambda g, p: p.update(mode=9), r"primitives\[0\]\.mode is 9; use triangles, strips or fans"),
        (
            lambda g, p: p.update(extensions={"KHR_draco_mesh_compression": {}}),
            r"primitives\[0\] needs KHR_draco_mesh_compression, which is not read; export without compression",
        ),
        (
            lambda g, p: p["attributes"].update(POSITION=g.add([[0, 0, 0], [1, 0, 0], [0, float("nan"), 0]])),
            r"POSITION names accessors\[1\], which holds values that are not finite",
        ),
        (lambda g, p: p["attributes"].update(COLOR_0=g.add([[0, 0, 0]])), "COLOR_0 has 1 elements, POSITION 3"),
        (
            lambda g, p: p.update(targets=[{"POSITION": g.add([[0, 0, 0]])}]),
            "targets.attributes.POSITION has 1 elements",
        ),
        (lambda g, p: p.update(material=0), r"primitives\[0\]\.material names materials\[0\] of 0"),
        (lambda g, p: g.tree["nodes"][0].update(skin=0), r"nodes\[…\]\.skin names skins\[0\] of 0"),
    ],
)
def test_primitives_that_contradict_themselves_are_named(tmp_path, change, message):
    glb = triangle()
    change(glb, glb.tree["meshes"][0]["primitives"][0])
    with pytest.raises(UserError, match=message):
        import_model(tmp_path, glb.write(tmp_path / "a.glb"))


def test_textures_without_an_image_and_bombs_are_named(tmp_path):
    glb = textured(triangle())
    glb.tree["textures"] = [{"extensions": {"KHR_texture_basisu": {"source": 0}}}]
    with pytest.raises(UserError, match=r"a texture names no image that is read \(KHR_texture_basisu\); use PNG"):
        import_model(tmp_path, glb.write(tmp_path / "a.glb"))
    glb = textured(triangle())
    header = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" + (100_000).to_bytes(4, "big") * 2
    glb.tree["images"][0]["bufferView"] = glb.view(header + b"\x08\2\0\0\0")
    with pytest.raises(UserError, match="a picture of 10000000000 pixels"):
        import_model(tmp_path, glb.write(tmp_path / "a.glb"))
