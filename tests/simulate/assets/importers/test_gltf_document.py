"""glTF files that are broken."""

from __future__ import annotations

import pytest
from support.gltf_files import triangle
from support.model_imports import import_model

from aerojax.core.errors import UserError


def _broken(change):
    glb = triangle()
    change(glb)
    return glb


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda g: g.tree.update(asset={"version": "1.0"}), r"asset\.version is 1\.0; export the model as glTF 2\.0"),
        (
            lambda g: g.tree.update(extensionsRequired=["KHR_draco_mesh_compression"]),
            "KHR_draco_mesh_compression, which",
        ),
        (lambda g: g.tree["nodes"][0].update(mesh=5), "names something that it lacks"),
        (lambda g: g.tree["accessors"][0].update(count=9), "an accessor reaches past"),
        (lambda g: g.tree["bufferViews"][0].update(byteLength=900), r"bufferViews\[0\] reaches past its buffer"),
        (lambda g: g.tree["scenes"][0].update(nodes=[0, 0]), r"nodes\[0\] has two parents"),
    ],
)
def test_broken_documents_are_named(tmp_path, change, message):
    _broken(change).write(tmp_path / "a.glb")
    with pytest.raises(UserError, match=message):
        import_model(tmp_path, "a.glb")


@pytest.mark.parametrize(
    ("name", "data", "message"),
    [
        ("a.glb", b"nothing of the kind", "not a GLB file"),
        ("a.glb", b"glTF\2\0\0\0\x20\0\0\0\xff\0\0\0JSON{}  ", "ends within a chunk"),
        ("a.glb", b"glTF\2\0\0\0\x18\0\0\0\4\0\0\0BIN\0    ", "has no JSON chunk"),
        ("a.gltf", b"{", "JSON of this glTF file cannot be read"),
        ("a.gltf", b'{"asset": {"version": "2.0"}, "buffers": [{"uri": "no.bin"}]}', "no.bin is missing"),
        ("a.gltf", b'{"asset": {"version": "2.0"}, "buffers": [{"uri": "data:;base64,?"}]}', "not valid base64"),
        ("a.gltf", b'{"asset": {"version": "2.0"}, "buffers": [{}]}', "no uri and the file no binary chunk"),
        ("a.gltf", b'{"asset": {"version": "2.0"}, "nodes": []}', "no visible UsdGeomMesh"),
    ],
)
def test_broken_files_are_named(tmp_path, name, data, message):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(UserError, match=message):
        import_model(tmp_path, name)
