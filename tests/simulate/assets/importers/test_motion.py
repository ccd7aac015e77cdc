"""Clips at their interpolations and speeds, and mirrored nodes."""

from __future__ import annotations

import numpy as np
import pytest
from support.gltf_files import triangle
from support.model_imports import animate, centred, import_model, relative

TURN = [0.0, 0.0, float(np.sqrt(0.5)), float(np.sqrt(0.5))]  # x, y, z, w: a quarter about z


@pytest.mark.parametrize(
    ("interpolation", "values", "expected"),
    [
        ("LINEAR", [[0, 0, 0], [4, 0, 0]], {0.25: 1.0, 0.5: 2.0, 0.999: 3.996}),
        ("STEP", [[0, 0, 0], [4, 0, 0]], {0.25: 0.0, 0.5: 0.0, 0.999: 0.0}),
        # out-tangent 8 at 0 and in-tangent 0 at 1: 8 (t³ - 2t² + t) + 4 (3t² - 2t³)
        ("CUBICSPLINE", [[0] * 3, [0] * 3, [8, 0, 0], [0] * 3, [4, 0, 0], [0] * 3], {0.25: 1.75, 0.5: 3.0}),
    ],
)
def test_interpolations_and_speed(tmp_path, interpolation, values, expected):
    glb = triangle()
    glb.tree["nodes"].append({"name": "anchor", "mesh": 0})
    glb.tree["scenes"] = [{"nodes": [1, 0]}]
    animate(glb, "translation", [2, 3], values, interpolation)  # a clip that starts late is brought to 0
    glb.write(tmp_path / "a.glb")
    mesh = import_model(tmp_path, "a.glb", "scale: 1.0, forward: +X, up: +Z, speed: 0.5")
    assert mesh.cycle_seconds == pytest.approx(2.0)
    for seconds, shift in expected.items():
        assert relative(mesh, 2 * seconds)[3, 0] == pytest.approx(shift, abs=2e-3)


def test_mirrored_nodes_keep_places_and_face_outwards(tmp_path):
    """A child of a mirrored, turned node: glTF turns the winding of what ends up mirrored."""
    glb = triangle()
    glb.tree["nodes"] = [
        {"children": [1, 2], "scale": [-1, 1, 1], "translation": [1, 2, 3], "rotation": TURN},
        {"mesh": 0, "translation": [5, 0, 0]},
        {"mesh": 0, "scale": [1, -2, 1]},
    ]
    mesh = import_model(tmp_path, glb.write(tmp_path / "a.glb"))
    parent = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]) @ np.diag([-1.0, 1, 1])
    local = np.array([[0.0, 0, 0], [2, 0, 0], [0, 1, 0]])
    first, second = (local + np.array([5, 0, 0])) @ parent.T, local * [1, -2, 1] @ parent.T
    assert mesh.vertices_at(0.0) == pytest.approx(centred(np.concatenate([first, second])), abs=1e-6)
    assert mesh.faces.tolist() == [[2, 1, 0], [3, 4, 5]]
