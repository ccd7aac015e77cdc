"""Small inputs made after public bug reports: the right value of each, or the right refusal."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from support.model_imports import import_model

from aerojax.core.errors import UserError
from aerojax.simulate.usd.animated_mesh import load_animated_mesh

INPUTS = (Path(__file__).resolve().parents[5] / "shared" / "bugs").resolve()
pytestmark = pytest.mark.skipif(not INPUTS.is_dir(), reason=f"inputs of bug reports not found at {INPUTS}")
BOX = ((2.0, 1.0, 0.5), 12, 7.0)
"""Size, triangles and area of the box that most of the files hold."""


def _measured(mesh, seconds=0.0):
    vertices = mesh.vertices_at(seconds).astype(float)
    a, b, c = np.moveaxis(vertices[mesh.faces], 1, 0)
    size = np.ptp(vertices[np.unique(mesh.faces)], axis=0)
    return (
        tuple(size.round(4).tolist()),
        len(mesh.faces),
        float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2),
    )


def _check(mesh, expected, seconds=0.0):
    size, faces, area = expected
    found = _measured(mesh, seconds)
    assert found[0] == pytest.approx(size, abs=1e-4) and found[1] == faces
    assert found[2] == pytest.approx(area, rel=2e-3)


STAR = 5 * 0.3 * np.sin(np.pi / 5)
ROTOR = 2 * np.pi * 2 * 0.1 + 2 * np.pi * 4


@pytest.mark.parametrize("imported", [False, True])
@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("guide", BOX),
        ("proxy", BOX),
        ("emptymesh", BOX),
        ("hole", ((2.0, 1.0, 0.5), 10, 6.5)),
        ("concave", ((1.809, 1.9021, 0.0), 8, STAR)),
        ("gprim", ((4.0, 4.0, 0.5), 12 + 4 * 64, 7.0 + ROTOR)),
        ("pinst", ((4.2, 4.2, 0.775), 12 * 5, 7.0 + 4 * 0.12)),
        ("noend", ((2.0, 1.0, 0.775), 24, 7.31)),
    ],
)
def test_usd_values(tmp_path, name, expected, imported):
    path = INPUTS / "usd" / f"{name}.usda"
    mesh = import_model(tmp_path, path, "scale: 1.0, forward: +X") if imported else load_animated_mesh(path)
    _check(mesh, expected)
    assert mesh.cycle_seconds == pytest.approx(1.0 if name == "noend" else 0.0)
    if name == "noend":  # the rotor, a meter long, lies across after a quarter of its turn
        rotor = mesh.vertices_at(0.25)[8:]
        assert np.ptp(rotor, axis=0) == pytest.approx([0.1, 1.0, 0.05], abs=1e-5)


@pytest.mark.parametrize("imported", [False, True])
@pytest.mark.parametrize(
    ("name", "missing"),
    [
        ("misspay", "not_there.usda@ for payload"),
        ("missref", "not_there.usda@ for reference"),
        ("misssub", "nope.usda@"),
    ],
)
def test_usd_refusals(tmp_path, name, missing, imported):
    path = INPUTS / "usd" / f"{name}.usda"
    with pytest.raises(UserError, match="put the file where the stage looks for it") as caught:
        import_model(tmp_path, path, "forward: +X") if imported else load_animated_mesh(path)
    assert caught.value.code == "missing" and missing in caught.value.problem
    assert caught.value.problem.startswith(str(path))


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        *[(name, BOX) for name in ("bom", "cont", "tabs", "tabm", "rgb", "space", "quoted")],
        ("L2", ((2.0, 2.0, 0.0), 4, 3.0)),
        ("U", ((3.0, 2.0, 0.0), 6, 5.0)),
    ],
)
def test_obj_values(tmp_path, name, expected):
    """Shapes; a red material behind tabs; a picture behind names with blanks; one red corner among white ones."""
    mesh = import_model(tmp_path, INPUTS / "obj" / f"{name}.obj")
    _check(mesh, expected)
    if name == "tabm":
        assert mesh.albedo == pytest.approx(np.tile([1.0, 0.0, 0.0], (12, 1)))
    if name in ("space", "quoted"):
        picture = cv2.imread(str(INPUTS / "obj" / "my texture.png"))[:, :, ::-1]
        assert (mesh.texture == 0).all() and np.array_equal(mesh.textures[0], picture)
        assert mesh.uv.min() == 0.0 and mesh.uv.max() == 1.0
    if name == "rgb":  # the mean of a red and two white corners in linear light, encoded
        pale = 1.055 * (2 / 3) ** (1 / 2.4) - 0.055
        red = (mesh.faces == 0).any(axis=1)
        assert mesh.albedo[red] == pytest.approx(np.tile([1.0, pale, pale], (red.sum(), 1)), abs=1e-6)
        assert 3 <= red.sum() <= 6 and mesh.albedo[~red] == pytest.approx(1.0)


def test_obj_refusals(tmp_path):
    with pytest.raises(UserError, match=r"nan\.obj: line 1 is not understood \('v nan nan nan'\); export it again"):
        import_model(tmp_path, INPUTS / "obj" / "nan.obj")


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        *[(name, BOX) for name in ("sk3", "vis", "zerovert", "zm")],
        ("zm2", ((2.0, 1.0, 0.5), 24, 9.0)),
        ("inst", ((4.2, 4.2, 0.775), 12 * 5, 7.0 + 4 * 0.12)),
        ("multi", ((5.0, 1.0, 0.775), 36, 7.0 + 2 * 0.31)),
    ],
)
def test_gltf_values(tmp_path, name, expected):
    mesh = import_model(tmp_path, INPUTS / "gltf" / f"{name}.glb")
    _check(mesh, expected)
    if name == "multi":  # both rotors, each of its own clip, lie across after a quarter of their turn
        assert mesh.cycle_seconds == pytest.approx(1.0)
        for rotor in (slice(8, 16), slice(16, 24)):
            assert np.ptp(mesh.vertices_at(0.25)[rotor], axis=0) == pytest.approx([0.1, 1.0, 0.05], abs=1e-5)
    else:
        assert mesh.cycle_seconds == 0.0


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("nan", r"POSITION names accessors\[2\], which holds values that are not finite; export"),
        ("oob", r"meshes\[0\]\.primitives\[0\]\.indices names vertex 99 of 8; export"),
    ],
)
def test_gltf_refusals(tmp_path, name, message):
    with pytest.raises(UserError, match=message) as caught:
        import_model(tmp_path, INPUTS / "gltf" / f"{name}.glb")
    assert caught.value.problem.startswith(str(INPUTS / "gltf" / f"{name}.glb"))
