"""Import of small models that the tests write: glTF by hand-computed numbers, and its mistakes."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdValidation
from support.gltf_files import triangle

from aerojax.core.errors import UserError
from aerojax.simulate.assets.catalogue import build_identity
from aerojax.simulate.assets.importers.identities import imported_identities
from aerojax.simulate.assets.importers.models import body_from_file
from aerojax.simulate.usd.animated_mesh import load_animated_mesh

TURN = [0.0, 0.0, float(np.sqrt(0.5)), float(np.sqrt(0.5))]  # x, y, z, w: a quarter about z
COLOURS = np.zeros((2, 4, 3), np.uint8)
COLOURS[0], COLOURS[1] = (200, 40, 20), (10, 60, 220)  # RGB of the upper and the lower half


def _listed(folder, file, fields="scale: 1.0, forward: +X, up: +Z", name="model", label="bird"):
    path = folder / "models.yaml"
    path.write_text(f"models:\n  - {{name: {name}, file: {file}, class: {label}, {fields}}}\n")
    return path


def _import(folder, file, fields="scale: 1.0, forward: +X, up: +Z", label="bird"):
    """Convert one model and load the stage, which must be valid."""
    identity = imported_identities(_listed(folder, file, fields, label=label))[0]
    path = build_identity(identity, folder / "assets")
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    errors = UsdValidation.ValidationContext(validators).Validate(Usd.Stage.Open(str(path)))
    assert [e.GetMessage() for e in errors] == []
    return load_animated_mesh(path)


def _centred(points):
    points = np.asarray(points, float)
    return points - (points.min(0) + points.max(0)) / 2


def _relative(mesh, seconds):
    """Vertices relative to the first one, which stays where it is in these files."""
    vertices = mesh.vertices_at(seconds)
    return vertices - vertices[0]


def _png(path, picture=COLOURS):
    assert cv2.imwrite(str(path), picture[..., ::-1])
    return path


def _animate(glb, path, times, values, interpolation="LINEAR", node=0):
    """Add a clip of one channel."""
    sampler = {"input": glb.add(times), "output": glb.add(values), "interpolation": interpolation}
    channel = {"sampler": 0, "target": {"node": node, "path": path}}
    glb.tree.setdefault("animations", []).append({"name": path, "samplers": [sampler], "channels": [channel]})


# glTF


def test_identity_carries_its_model(tmp_path):
    triangle().write(tmp_path / "a.glb")
    fields = "forward: +X, up: +Y, split: val, licence: MIT, source: mine"
    (one,) = imported_identities(_listed(tmp_path, "a.glb", fields, name="my_bird"))
    assert (one.name, one.label, one.family, one.split) == ("my_bird", "bird", "imported", "val")
    assert one.model is not None and (one.model.licence, one.model.source, one.model.scale) == ("MIT", "mine", "auto")


def test_axes_and_scale(tmp_path):
    """The default axes of glTF, nose +Z and up +Y, so that its +X is the body's left, +Y."""
    triangle().write(tmp_path / "a.glb")
    mesh = _import(tmp_path, "a.glb", "scale: 0.5")
    assert mesh.vertices_at(0.0) == pytest.approx(_centred([[0, 0, 0], [0, 1, 0], [0, 0, 0.5]]), abs=1e-7)
    assert mesh.faces.tolist() == [[0, 1, 2]] and mesh.cycle_seconds == 0.0
    mesh = _import(tmp_path, "a.glb", "scale: auto")
    assert np.ptp(mesh.vertices_at(0.0)[:, 1]) == pytest.approx(1.0)


@pytest.mark.parametrize("forward", ["+X", "-X", "+Y", "-Y", "+Z", "-Z"])
def test_axes_make_rotations(forward):
    for up in ("+X", "-Y", "+Z"):
        if up[1] != forward[1]:
            turn = body_from_file(forward, up)
            assert np.linalg.det(turn) == pytest.approx(1.0) and turn @ turn.T == pytest.approx(np.eye(3))


def test_changed_list_converts_again(tmp_path):
    triangle().write(tmp_path / "a.glb")
    before = _import(tmp_path, "a.glb", "scale: 1.0, forward: +X, up: +Z").vertices_at(0.0)
    kept = (tmp_path / "assets" / "model.usdc").stat().st_mtime_ns
    _import(tmp_path, "a.glb", "scale: 1.0, forward: +X, up: +Z")
    assert (tmp_path / "assets" / "model.usdc").stat().st_mtime_ns == kept
    after = _import(tmp_path, "a.glb", "scale: 3.0, forward: +X, up: +Z").vertices_at(0.0)
    assert after == pytest.approx(3 * before, abs=1e-6)


def test_strips_fans_quantised_and_strided_accessors(tmp_path):
    glb = triangle()
    rows = np.array([[0, 0, 0, 9], [127, 0, 0, 9], [0, 127, 0, 9], [127, 127, 0, 9]], np.int8)
    view = glb.view(rows.tobytes(), byteStride=4)
    quad = glb.entry({"bufferView": view, "count": 4, "componentType": 5120, "type": "VEC3", "normalized": True})
    strip, fan = {"attributes": {"POSITION": quad}, "mode": 5}, {"attributes": {"POSITION": quad}, "mode": 6}
    lines = {"attributes": {"POSITION": quad}, "mode": 1}
    glb.tree["meshes"] = [{"primitives": [strip, fan, lines]}]
    mesh = _import(tmp_path, glb.write(tmp_path / "a.glb"))
    assert mesh.faces.tolist() == [[0, 1, 2], [1, 3, 2], [5, 6, 4], [6, 7, 4]]
    assert np.ptp(mesh.vertices_at(0.0), axis=0) == pytest.approx([1, 1, 0])


def test_mirrored_nodes_keep_places_and_face_outwards(tmp_path):
    """A child of a mirrored, turned node: glTF turns the winding of what ends up mirrored."""
    glb = triangle()
    glb.tree["nodes"] = [
        {"children": [1, 2], "scale": [-1, 1, 1], "translation": [1, 2, 3], "rotation": TURN},
        {"mesh": 0, "translation": [5, 0, 0]},
        {"mesh": 0, "scale": [1, -2, 1]},
    ]
    mesh = _import(tmp_path, glb.write(tmp_path / "a.glb"))
    parent = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]) @ np.diag([-1.0, 1, 1])
    local = np.array([[0.0, 0, 0], [2, 0, 0], [0, 1, 0]])
    first, second = (local + np.array([5, 0, 0])) @ parent.T, local * [1, -2, 1] @ parent.T
    assert mesh.vertices_at(0.0) == pytest.approx(_centred(np.concatenate([first, second])), abs=1e-6)
    assert mesh.faces.tolist() == [[2, 1, 0], [3, 4, 5]]


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
    _animate(glb, "weights", [0, 1], [0, 0.25, 1, 0.25])
    glb.write(tmp_path / "a.glb")
    mesh = _import(tmp_path, "a.glb")
    assert mesh.cycle_seconds == pytest.approx(1.0)
    assert _relative(mesh, 0.5) == pytest.approx(np.array([[0, 0, 0], [2, 0, 2], [0, 3, 0]]), abs=1e-6)
    still = _import(tmp_path, "a.glb", "scale: 1.0, forward: +X, up: +Z, animation: none")
    assert still.cycle_seconds == 0.0
    assert _relative(still, 0.5) == pytest.approx(np.array([[0, 0, 0], [2, 0, 0], [0, 3, 0]]), abs=1e-6)


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
    _animate(glb, "rotation", [0, 2], [[0, 0, 0, 1], TURN], node=3)
    mesh = _import(tmp_path, glb.write(tmp_path / "a.glb"))
    assert _relative(mesh, 0.0)[1] == pytest.approx([6, 0, 0], abs=1e-5)
    half = 2 * np.array([1 + 2 * np.sqrt(0.5), 2 * np.sqrt(0.5), 0])
    assert _relative(mesh, 1.0)[1] == pytest.approx(half, abs=1e-5)
    assert _relative(mesh, 1.0)[2] == pytest.approx([0, 2, 0], abs=1e-5)


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
    _animate(glb, "translation", [2, 3], values, interpolation)  # a clip that starts late is brought to 0
    glb.write(tmp_path / "a.glb")
    mesh = _import(tmp_path, "a.glb", "scale: 1.0, forward: +X, up: +Z, speed: 0.5")
    assert mesh.cycle_seconds == pytest.approx(2.0)
    for seconds, shift in expected.items():
        assert _relative(mesh, 2 * seconds)[3, 0] == pytest.approx(shift, abs=2e-3)


def test_clip_is_chosen_by_number_or_name(tmp_path):
    glb = triangle()
    for path, seconds in (("translation", 1), ("scale", 3)):
        _animate(glb, path, [0, seconds], [[1, 1, 1], [2, 2, 2]])
    glb.write(tmp_path / "a.glb")
    for animation, seconds in (("0", 1), ("1", 3), ("scale", 3), ("none", 0)):
        fields = f"scale: 1.0, forward: +X, up: +Z, animation: {animation}"
        assert _import(tmp_path, "a.glb", fields).cycle_seconds == seconds
    with pytest.raises(UserError, match=r"animation is 'flap', but the file has 0 \(translation\), 1 \(scale\)"):
        _import(tmp_path, "a.glb", "scale: 1.0, animation: flap")
    with pytest.raises(UserError, match="animation is 7, but the file has"):
        _import(tmp_path, "a.glb", "scale: 1.0, animation: 7")


def test_matrix_nodes_are_taken_apart(tmp_path):
    glb = triangle()
    matrix = np.eye(4)
    matrix[:3, :3] = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]) * [2.0, 3.0, 1.0]
    matrix[:3, 3] = [7, 8, 9]
    glb.tree["nodes"][0]["matrix"] = matrix.T.reshape(-1).tolist()
    mesh = _import(tmp_path, glb.write(tmp_path / "a.glb"))
    assert _relative(mesh, 0.0) == pytest.approx(np.array([[0, 0, 0], [0, 4, 0], [-3, 0, 0]]), abs=1e-6)


def _textured(glb, folder, picture=COLOURS, colour=(1, 1, 1, 1), uv=((0, 0), (1, 0), (0, 0.4)), **reference):
    """Give the triangle of a GLB a texture; these coordinates lie in the picture's upper half."""
    encoded = _png(folder / "source.png", picture).read_bytes()
    glb.tree["images"] = [{"bufferView": glb.view(encoded), "mimeType": "image/png"}]
    glb.tree["textures"] = [{"source": 0}]
    surface = {"baseColorTexture": {"index": 0, **reference}, "baseColorFactor": list(colour)}
    glb.tree["materials"] = [{"name": "paint", "pbrMetallicRoughness": surface}]
    primitive = glb.tree["meshes"][0]["primitives"][0]
    primitive["material"] = 0
    primitive["attributes"]["TEXCOORD_0"] = glb.add(uv)
    return glb


def _shown(mesh):
    """The texel in the middle of the first face."""
    u, v = mesh.uv[0].mean(axis=0)
    picture = mesh.textures[mesh.texture[0]]
    return picture[int((1 - v) % 1 * picture.shape[0]), int(u % 1 * picture.shape[1])]


def test_texture_arrives_the_right_way_up(tmp_path):
    _textured(triangle(), tmp_path).write(tmp_path / "a.glb")
    mesh = _import(tmp_path, "a.glb")
    assert _shown(mesh).tolist() == [200, 40, 20]
    assert (tmp_path / "assets" / "model.png").is_file()
    stage = Usd.Stage.Open(str(tmp_path / "assets" / "model.usdc"))
    colour = UsdGeom.Mesh(next(p for p in stage.Traverse() if p.IsA(UsdGeom.Mesh))).GetDisplayColorAttr().Get()
    linear = ((np.array([200, 40, 20]) / 255 + 0.055) / 1.055) ** 2.4
    assert np.array(colour)[0] == pytest.approx(linear, rel=1e-3)


def test_texture_transform_moves_it_to_the_lower_half(tmp_path):
    moved = {"extensions": {"KHR_texture_transform": {"offset": [0, 0.5]}}}
    glb = _textured(triangle(), tmp_path, **moved)
    glb.tree["extensionsRequired"] = ["KHR_texture_transform"]
    glb.write(tmp_path / "a.glb")
    assert _shown(_import(tmp_path, "a.glb")).tolist() == [10, 60, 220]


def test_colour_factor_is_multiplied_in_linear_light(tmp_path):
    _textured(triangle(), tmp_path, colour=(0.5, 0.5, 0.5, 1)).write(tmp_path / "a.glb")
    linear = 0.5 * ((np.array([200, 40, 20]) / 255 + 0.055) / 1.055) ** 2.4
    expected = (1.055 * linear ** (1 / 2.4) - 0.055) * 255
    assert _shown(_import(tmp_path, "a.glb")) == pytest.approx(expected, abs=1)


def test_alpha_is_kept_where_the_material_uses_it(tmp_path):
    picture = np.concatenate([COLOURS, np.full((2, 4, 1), 99, np.uint8)], axis=2)
    glb = _textured(triangle(), tmp_path, COLOURS)
    encoded = cv2.imencode(".png", picture[..., [2, 1, 0, 3]])[1].tobytes()
    glb.tree["images"][0]["bufferView"] = glb.view(encoded)
    glb.tree["materials"][0] |= {"alphaMode": "MASK", "alphaCutoff": 0.3}
    _import(tmp_path, glb.write(tmp_path / "a.glb"))
    written = cv2.imread(str(tmp_path / "assets" / "model.png"), cv2.IMREAD_UNCHANGED)
    assert np.array_equal(written[..., [2, 1, 0, 3]], picture)


def test_two_pictures_have_two_names(tmp_path):
    glb = _textured(triangle(), tmp_path)
    other = {"baseColorTexture": {"index": 0}, "baseColorFactor": [1, 0, 0, 1]}
    glb.tree["materials"].append({"pbrMetallicRoughness": other})
    glb.tree["meshes"][0]["primitives"].append({**glb.tree["meshes"][0]["primitives"][0], "material": 1})
    mesh = _import(tmp_path, glb.write(tmp_path / "a.glb"))
    assert sorted(p.name for p in (tmp_path / "assets").glob("*.png")) == ["model.0.png", "model.1.png"]
    assert len(mesh.textures) == 2 and mesh.texture.tolist() == [0, 1]


# glTF files that are broken


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
        _import(tmp_path, "a.glb")


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
        _import(tmp_path, name)


def test_broken_picture_is_named(tmp_path):
    glb = _textured(triangle(), tmp_path)
    glb.tree["images"][0]["bufferView"] = glb.view(b"no picture")
    with pytest.raises(UserError, match="a texture is not a readable PNG or JPEG"):
        _import(tmp_path, glb.write(tmp_path / "a.glb"))
