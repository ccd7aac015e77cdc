"""The list of models with all its mistakes, and axes of files."""

from __future__ import annotations

import numpy as np
import pytest
from support.gltf_files import triangle

from aerojax.core.errors import UserError
from aerojax.simulate.assets.catalogue import build_identity
from aerojax.simulate.assets.importers.identities import imported_identities
from aerojax.simulate.assets.importers.models import body_from_file, read_models


@pytest.mark.parametrize("forward", ["+X", "-X", "+Y", "-Y", "+Z", "-Z"])
def test_axes_make_rotations(forward):
    for up in ("+X", "-Y", "+Z"):
        if up[1] != forward[1]:
            turn = body_from_file(forward, up)
            assert np.linalg.det(turn) == pytest.approx(1.0) and turn @ turn.T == pytest.approx(np.eye(3))


def _read(folder, text):
    path = folder / "models.yaml"
    path.write_text(text)
    return read_models(path)


def test_every_mistake_of_a_list_is_named_at_once(tmp_path):
    triangle().write(tmp_path / "a.glb")
    (tmp_path / "a.obj").write_text("")
    text = """
models:
  - {name: 1st, file: a.glb, class: plane, split: all, forward: up, scale: big, speed: 0, animation: -1, colour: red}
  - {file: missing.glb, class: bird, name: twice}
  - {name: twice, file: a.obj, class: bird}
  - {name: c, file: a.fbx, class: bird, up: +Y, forward: -Y}
  - {name: d, file: a.glb, class: bird, up: 3, scale: true, speed: fast, animation: [1]}
  - just words
  - {name: e, file: a.glb, class: bird, up: +Z}
  - {}
"""
    with pytest.raises(UserError) as caught:
        _read(tmp_path, text)
    expected = [
        "models.yaml does not fit a list of models",
        "models[0] (1st): unknown field(s) colour; use name, file, class",
        "models[0] (1st): name: '1st' is no file and prim name; use letters",
        "models[0] (1st): class: 'plane' is unknown; use bird, drone, airplane, helicopter",
        "models[0] (1st): split: 'all' is unknown; use train, val, test",
        "models[0] (1st): forward: 'up' is no axis; use +X, +Y",
        "models[0] (1st): scale: 'big' is neither auto nor a positive number; give metres per unit",
        "models[0] (1st): speed: 0 must be a positive number",
        "models[0] (1st): animation: -1 must not be negative; count clips from 0",
        f"models[1] (twice): file: {tmp_path / 'missing.glb'} does not exist; give it relative to models.yaml",
        "models[2] (twice): forward: is missing, and .obj has no convention",
        "models[2] (twice): up: is missing, and .obj has no convention",
        "models[3] (c): up: +Y lies along forward (-Y); the two must be perpendicular",
        "models[3] (c): file: a.fbx has no known ending; use .glb, .gltf, .obj, .usd",
        "models[4] (d): up: expected str, got 3",
        "models[4] (d): scale: expected int or float or str, got True",
        "models[4] (d): speed: expected int or float, got 'fast'",
        "models[4] (d): animation: expected int or str or nothing, got [1]",
        "models[5]: expected fields, got 'just words'",
        "models[6] (e): forward: +Z and up: +Z lie along one line; give both",
        "models[7]: name: required field is missing",
        "models[7]: file: required field is missing",
        "models[7]: class: required field is missing",
        "name 'twice' is given to several models",
    ]
    assert [line for line in expected if line not in str(caught.value)] == []
    assert len(str(caught.value).splitlines()) == len(expected)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("models: [", "is not readable YAML"),
        ("- name: a", "holds no list `models:`"),
        ("models: {}\n", "holds no list `models:`"),
        ("models: []\nextra: 1\n", "or more than it"),
        ("models: 2001-99-99", "is not readable YAML"),
        ("models: " + "[" * 20_000, "is not readable YAML"),
    ],
)
def test_files_that_are_no_list(tmp_path, text, message):
    with pytest.raises(UserError, match=message):
        _read(tmp_path, text)


def test_whole_numbers_are_numbers(tmp_path):
    triangle().write(tmp_path / "a.glb")
    (model,) = _read(tmp_path, "models:\n  - {name: a, file: a.glb, class: bird, scale: 2, speed: 3}\n")
    assert (model.scale, model.speed) == (2.0, 3.0)
    huge = "9" * 400
    with pytest.raises(UserError, match=r"(?s)scale: 9+ is neither auto nor .*speed: 9+ must be a positive number"):
        _read(tmp_path, f"models:\n  - {{name: a, file: a.glb, class: bird, scale: {huge}, speed: {huge}}}\n")


def test_missing_list_and_missing_model(tmp_path):
    with pytest.raises(UserError, match=r"list of models .* does not exist"):
        read_models(tmp_path / "none.yaml")
    triangle().write(tmp_path / "a.glb")
    (tmp_path / "models.yaml").write_text("models:\n  - {name: a, file: a.glb, class: bird}\n")
    identity = imported_identities(tmp_path / "models.yaml")[0]
    (tmp_path / "a.glb").unlink()
    with pytest.raises(UserError, match=r"model a: file .* does not exist; correct the list"):
        build_identity(identity, tmp_path)
