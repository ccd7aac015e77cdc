"""glTF files that are broken."""

from __future__ import annotations

import base64
import json
from urllib.parse import quote

import numpy as np
import pytest
from support.gltf_files import triangle
from support.model_imports import import_model

from aerojax.core.errors import UserError

ZEROS = {"count": 3, "componentType": 5126, "type": "VEC3"}
FAR = {"count": 1, "indices": {"bufferView": 0, "componentType": 5121, "byteOffset": 36}, "values": {"bufferView": 0}}


def _broken(change):
    glb = triangle()
    glb.tree["bufferViews"][0]["byteLength"] += 4
    glb.binary += b"\3\0\0\0"
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
        (lambda g: g.tree["nodes"][0].update(mesh=5), r"nodes\[0\]\.mesh names meshes\[5\] of 1; export"),
        (lambda g: g.tree["accessors"][0].update(count=9), "an accessor reaches past"),
        (lambda g: g.tree["bufferViews"][0].update(byteLength=900), r"bufferViews\[0\] reaches past its buffer"),
        (lambda g: g.tree["scenes"][0].update(nodes=[0, 0]), r"nodes\[0\] has two parents"),
        (lambda g: g.tree["scenes"][0].update(nodes=[-1]), r"scenes\[…\]\.nodes names nodes\[-1\] of 1"),
        (lambda g: g.tree.update(nodes={}), "nodes is not a list of objects"),
        (lambda g: g.tree["nodes"][0].update(translation=[0, 0]), r"nodes\[0\]\.translation is \[0, 0\], not 3 finite"),
        (lambda g: g.tree["nodes"][0].update(scale=[1, float("nan"), 1]), r"nodes\[0\]\.scale is .*, not 3 finite"),
        (lambda g: g.tree["nodes"][0].update(rotation=[0, 0, 0, 0]), r"nodes\[0\]\.rotation is zero"),
        (lambda g: g.tree["nodes"][0].update(children=7), "is not as the format says"),
        (lambda g: g.tree["accessors"][0].update(type="VEC2"), r"accessors\[0\] of type VEC2, not VEC3"),
        (lambda g: g.tree["accessors"][0].update(count=-1), r"accessors\[0\] has no known componentType, type, count"),
        (lambda g: g.tree["accessors"][0].update(byteOffset=-4), r"accessors\[0\] has no known"),
        (lambda g: g.tree["bufferViews"][0].update(byteStride=8), r"byteStride is 8, less than an element"),
        (lambda g: g.tree["bufferViews"][0].update(byteOffset=-4), r"bufferViews\[0\] names bytes -4"),
        (lambda g: g.tree["accessors"].__setitem__(0, {**ZEROS, "count": 10**15}), r"elements and no bufferView"),
        (lambda g: g.tree["accessors"].__setitem__(0, {**ZEROS, "sparse": FAR}), r"sparse names element 3 of 3"),
        (
            lambda g: g.tree["bufferViews"][0].update(extensions={"EXT_meshopt_compression": {}}),
            "EXT_meshopt_compression is not read; export without compression",
        ),
    ],
)
def test_broken_documents_are_named(tmp_path, change, message):
    _broken(change).write(tmp_path / "a.glb")
    with pytest.raises(UserError, match=message):
        import_model(tmp_path, "a.glb")


def test_buffers_lie_in_data_uris_or_beside_the_document(tmp_path):
    """Base64, percent-encoded, and a file whose name is written with a blank and another machine's slash."""
    glb = triangle()
    (tmp_path / "my points.bin").write_bytes(glb.binary)
    encoded = base64.b64encode(glb.binary).decode()
    for uri in (
        f"data:application/gltf-buffer;base64,{encoded}",
        f"data:,{quote(glb.binary)}",
        "buffers\\my%20points.bin",
    ):
        tree = {**glb.tree, "buffers": [{"uri": uri, "byteLength": len(glb.binary)}]}
        (tmp_path / "a.gltf").write_text(json.dumps(tree))
        assert np.ptp(import_model(tmp_path, "a.gltf").vertices_at(0.0), axis=0) == pytest.approx([2, 1, 0])


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
        ("a.gltf", b"[]", "is no glTF document"),
        ("a.gltf", b"[" * 100_000, "JSON of this glTF file cannot be read"),
        ("a.gltf", b'{"asset": {"version": "2.0"}, "buffers": [{"uri": 7}]}', "uri is 7"),
        ("a.gltf", b'{"asset": {"version": "2.0"}, "buffers": [{"uri": "%00' + b"x" * 3000 + b'"}]}', "is missing"),
    ],
)
def test_broken_files_are_named(tmp_path, name, data, message):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(UserError, match=message):
        import_model(tmp_path, name)
