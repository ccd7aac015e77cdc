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


def test_flat_and_mirrored_matrices(tmp_path):
    """An axis of no length flattens, a negative determinant mirrors; two axes of no length leave nothing to see."""
    glb = triangle()
    points = glb.add([[0, 0, 0], [2, 0, 0], [0, 1, 0], [0, 0, 3]])
    corners = glb.add([0, 1, 2, 0, 1, 3, 0, 2, 3], "uint8")
    glb.tree["meshes"] = [{"primitives": [{"attributes": {"POSITION": points}, "indices": corners}]}]
    flat, mirrored, nothing = np.diag([1.0, 1, 0, 1]), np.diag([-1.0, 1, 1, 1]), np.diag([0.0, 0, 1, 1])
    nothing[:3, 3] = [90, 90, 90]
    for matrix, size in ((flat, [2, 1, 0]), (mirrored, [2, 1, 3]), (mirrored @ flat, [2, 1, 0])):
        glb.tree["nodes"] = [{"mesh": 0, "matrix": m.T.reshape(-1).tolist()} for m in (matrix, nothing)]
        glb.tree["scenes"] = [{"nodes": [0, 1]}]
        mesh = import_model(tmp_path, glb.write(tmp_path / "a.glb"))
        assert len(mesh.part_names) == 1 and np.ptp(mesh.vertices_at(0.0), axis=0) == pytest.approx(size, abs=1e-6)


def test_matrices_that_shear_are_refused(tmp_path):
    glb = triangle()
    glb.tree["nodes"][0]["matrix"] = [1, 0, 0, 0, 1, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
    with pytest.raises(UserError, match=r"nodes\[0\]\.matrix shears, which no node can; apply the transform"):
        import_model(tmp_path, glb.write(tmp_path / "a.glb"))


def test_nodes_that_are_not_visible_hide_what_hangs_from_them(tmp_path):
    glb = triangle()
    hidden = {"KHR_node_visibility": {"visible": False}}
    glb.tree["nodes"] = [{"mesh": 0, "name": "seen"}, {"mesh": 0, "extensions": hidden, "children": [2]}, {"mesh": 0}]
    glb.tree["scenes"] = [{"nodes": [0, 1]}]
    glb.tree["extensionsRequired"] = ["KHR_node_visibility"]
    mesh = import_model(tmp_path, glb.write(tmp_path / "a.glb"))
    assert [name.split("/")[-2] for name in mesh.part_names] == ["seen"]


def test_copies_are_made_at_their_places(tmp_path):
    """Translated, turned a quarter about z (as normalised shorts), scaled; below a node that is itself moved."""
    glb = triangle()
    turn = [[0, 0, 0, 32767], [0, 0, 23170, 23170]]
    places = {
        "TRANSLATION": glb.add([[10, 0, 0], [20, 0, 0]]),
        "ROTATION": glb.add(turn, "int16", normalized=True),
        "SCALE": glb.add([[1, 1, 1], [3, 3, 3]]),
    }
    extension = {"EXT_mesh_gpu_instancing": {"attributes": places}}
    glb.tree["nodes"] = [{"name": "still", "mesh": 0}, {"translation": [0, 0, 7], "children": [2]}, {}]
    glb.tree["nodes"][2] = {"mesh": 0, "extensions": extension}
    glb.tree["scenes"] = [{"nodes": [0, 1]}]
    mesh = import_model(tmp_path, glb.write(tmp_path / "a.glb"))
    expected = [[10, 0, 7], [12, 0, 7], [10, 1, 7], [20, 0, 7], [20, 6, 7], [17, 0, 7]]
    assert relative(mesh, 0.0)[3:] == pytest.approx(np.array(expected, float), abs=1e-3)
    places["SCALE"] = glb.add([[1, 1, 1]])
    with pytest.raises(UserError, match=r"nodes\[2\]\.EXT_mesh_gpu_instancing gives 1 and 2 copies"):
        import_model(tmp_path, glb.write(tmp_path / "a.glb"))


def test_the_default_scene_counts_and_its_skins_only(tmp_path):
    glb = triangle()
    glb.tree["nodes"] = [{"mesh": 0, "name": "other", "skin": 0}, {"mesh": 0, "name": "mine"}, {}]
    glb.tree["skins"] = [{"joints": [2]}]
    glb.tree |= {"scenes": [{"nodes": [0, 2]}, {"nodes": [1]}], "scene": 1}
    mesh = import_model(tmp_path, glb.write(tmp_path / "a.glb"))
    assert [name.split("/")[-2] for name in mesh.part_names] == ["mine"]


def _skinned(tmp_path, matrices, joints=((0, 0, 0, 0),) * 3):
    glb = triangle()
    attributes = glb.tree["meshes"][0]["primitives"][0]["attributes"]
    attributes |= {"JOINTS_0": glb.add(joints, "uint8"), "WEIGHTS_0": glb.add([[1, 0, 0, 0]] * 3)}
    glb.tree["skins"] = [{"joints": [1, 2], "inverseBindMatrices": glb.add([m.T.reshape(-1) for m in matrices])}]
    glb.tree["nodes"] = [{"mesh": 0, "skin": 0}, {"name": "a", "children": [2]}, {"name": "b"}]
    glb.tree["scenes"] = [{"nodes": [0, 1]}]
    return import_model(tmp_path, glb.write(tmp_path / "a.glb"))


def test_singular_bind_matrices_of_idle_joints_do_not_matter(tmp_path):
    mesh = _skinned(tmp_path, [np.eye(4), np.zeros((4, 4))])
    assert relative(mesh, 0.0) == pytest.approx(np.array([[0, 0, 0], [2, 0, 0], [0, 1, 0]], float), abs=1e-6)
    with pytest.raises(UserError, match=r"inverseBindMatrices\[0\] is singular, but its joint moves vertices"):
        _skinned(tmp_path, [np.zeros((4, 4)), np.eye(4)])
    with pytest.raises(UserError, match=r"JOINTS_0 names joint 9 of the 2 of skins\[0\]"):
        _skinned(tmp_path, [np.eye(4), np.eye(4)], [(9, 0, 0, 0)] * 3)


def test_sizes_are_bounded_before_anything_is_written(tmp_path):
    """Many nodes; and few that name one mesh of 30,000 faces over three vertices."""
    glb = triangle()
    glb.tree["scenes"] = [{"nodes": list(range(70_000))}]
    glb.tree["nodes"] = [{"mesh": 0}] * 70_000
    with pytest.raises(UserError, match="the scene has more than 65535 nodes; merge them"):
        import_model(tmp_path, glb.write(tmp_path / "a.glb"))
    glb.tree["scenes"] = [{"nodes": list(range(700))}]
    corners = glb.add(np.tile([0, 1, 2], 30_000), "uint8")
    glb.tree["meshes"][0]["primitives"][0]["indices"] = corners
    with pytest.raises(UserError, match=r"holds 2\.1e\+07 triangles, more than 2e\+07; simplify it"):
        import_model(tmp_path, glb.write(tmp_path / "a.glb"))
