"""glTF scenes by hand-computed numbers: primitives, nodes, clips."""

from __future__ import annotations

import numpy as np
import pytest
from support.gltf_files import triangle
from support.model_imports import animate, import_model, relative

from aerojax.core.errors import UserError


def test_strips_fans_quantised_and_strided_accessors(tmp_path):
    glb = triangle()
    rows = np.array([[0, 0, 0, 9], [127, 0, 0, 9], [0, 127, 0, 9], [127, 127, 0, 9]], np.int8)
    view = glb.view(rows.tobytes(), byteStride=4)
    quad = glb.entry({"bufferView": view, "count": 4, "componentType": 5120, "type": "VEC3", "normalized": True})
    strip, fan = {"attributes": {"POSITION": quad}, "mode": 5}, {"attributes": {"POSITION": quad}, "mode": 6}
    lines = {"attributes": {"POSITION": quad}, "mode": 1}
    glb.tree["meshes"] = [{"primitives": [strip, fan, lines]}]
    mesh = import_model(tmp_path, glb.write(tmp_path / "a.glb"))
    assert mesh.faces.tolist() == [[0, 1, 2], [1, 3, 2], [5, 6, 4], [6, 7, 4]]
    assert np.ptp(mesh.vertices_at(0.0), axis=0) == pytest.approx([1, 1, 0])


def test_clip_is_chosen_by_number_or_name(tmp_path):
    glb = triangle()
    for path, seconds in (("translation", 1), ("scale", 3)):
        animate(glb, path, [0, seconds], [[1, 1, 1], [2, 2, 2]])
    glb.write(tmp_path / "a.glb")
    for animation, seconds in (("0", 1), ("1", 3), ("scale", 3), ("none", 0)):
        fields = f"scale: 1.0, forward: +X, up: +Z, animation: {animation}"
        assert import_model(tmp_path, "a.glb", fields).cycle_seconds == seconds
    with pytest.raises(UserError, match=r"animation is 'flap', but the file has 0 \(translation\), 1 \(scale\)"):
        import_model(tmp_path, "a.glb", "scale: 1.0, animation: flap")
    with pytest.raises(UserError, match="animation is 7, but the file has"):
        import_model(tmp_path, "a.glb", "scale: 1.0, animation: 7")


def test_matrix_nodes_are_taken_apart(tmp_path):
    glb = triangle()
    matrix = np.eye(4)
    matrix[:3, :3] = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]) * [2.0, 3.0, 1.0]
    matrix[:3, 3] = [7, 8, 9]
    glb.tree["nodes"][0]["matrix"] = matrix.T.reshape(-1).tolist()
    mesh = import_model(tmp_path, glb.write(tmp_path / "a.glb"))
    assert relative(mesh, 0.0) == pytest.approx(np.array([[0, 0, 0], [0, 4, 0], [-3, 0, 0]]), abs=1e-6)
