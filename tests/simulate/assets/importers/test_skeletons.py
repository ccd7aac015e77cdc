"""Skins and morph targets of glTF files."""

from __future__ import annotations

import numpy as np
import pytest
from support.gltf_files import triangle
from support.model_imports import animate, import_model, relative

TURN = [0.0, 0.0, float(np.sqrt(0.5)), float(np.sqrt(0.5))]  # x, y, z, w: a quarter about z


def test_morph_targets_and_sparse_accessors(tmp_path):
    """Half way up the ramp the point has gone half of (0, 0, 4); the second target stands at its default of 0.25."""
    glb = triangle()
    moved = glb.view(np.array([1], np.uint16).tobytes())
    offset = glb.view(np.array([0, 0, 4], np.float32).tobytes())
    sparse = {"count": 1, "indices": {"bufferView": moved, "componentType": 5123}, "values": {"bufferView": offset}}
    first = glb.entry({"componentType": 5126, "count": 3, "type": "VEC3", "sparse": sparse})
    second = glb.add([[0, 0, 0], [0, 0, 0], [0, 8, 0]])
    glb.tree["meshes"][0]["primitives"][0]["targets"] = [{"POSITION": first}, {"POSITION": second}]
    glb.tree["meshes"][0]["weights"] = [0.0, 0.25]
    animate(glb, "weights", [0, 1], [0, 0.25, 1, 0.25])
    glb.write(tmp_path / "a.glb")
    mesh = import_model(tmp_path, "a.glb")
    assert mesh.cycle_seconds == pytest.approx(1.0)
    assert relative(mesh, 0.5) == pytest.approx(np.array([[0, 0, 0], [2, 0, 2], [0, 3, 0]]), abs=1e-6)
    still = import_model(tmp_path, "a.glb", "scale: 1.0, forward: +X, up: +Z, animation: none")
    assert still.cycle_seconds == 0.0
    assert relative(still, 0.5) == pytest.approx(np.array([[0, 0, 0], [2, 0, 0], [0, 3, 0]]), abs=1e-6)


def test_skin_with_morph_under_a_moving_holder(tmp_path):
    """The joint turns a quarter about its pivot (1, 0, 0); the morph acts before; the mesh's own node does nothing."""
    glb = triangle()
    primitive = glb.tree["meshes"][0]["primitives"][0]
    primitive["attributes"] |= {
        "JOINTS_0": glb.add([[0, 1, 0, 0]] * 3, "uint8"),
        "WEIGHTS_0": glb.add([[255, 0, 0, 0], [0, 255, 0, 0], [255, 0, 0, 0]], "uint8", normalized=True),
    }
    primitive["targets"] = [{"POSITION": glb.add([[0, 0, 0], [1, 0, 0], [0, 0, 0]])}]
    bind = [np.eye(4), np.eye(4)]
    bind[1][:3, 3] = [-1, 0, 0]
    glb.tree["skins"] = [{"joints": [2, 3], "inverseBindMatrices": glb.add([m.T.reshape(-1) for m in bind])}]
    glb.tree["nodes"] = [
        {"name": "mesh", "mesh": 0, "skin": 0, "translation": [50, 0, 0], "weights": [1.0]},
        {"name": "holder", "children": [2], "scale": [2, 2, 2]},
        {"name": "root", "children": [3]},
        {"name": "tip", "translation": [1, 0, 0]},
    ]
    glb.tree["scenes"] = [{"nodes": [0, 1]}]
    animate(glb, "rotation", [0, 2], [[0, 0, 0, 1], TURN], node=3)
    mesh = import_model(tmp_path, glb.write(tmp_path / "a.glb"))
    assert relative(mesh, 0.0)[1] == pytest.approx([6, 0, 0], abs=1e-5)
    half = 2 * np.array([1 + 2 * np.sqrt(0.5), 2 * np.sqrt(0.5), 0])
    assert relative(mesh, 1.0)[1] == pytest.approx(half, abs=1e-5)
    assert relative(mesh, 1.0)[2] == pytest.approx([0, 2, 0], abs=1e-5)
