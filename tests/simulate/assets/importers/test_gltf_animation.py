"""Clips of glTF files: which play, how long, and what contradicts itself."""

from __future__ import annotations

import numpy as np
import pytest
from support.gltf_files import triangle
from support.model_imports import animate, import_model, relative

from aerojax.core.errors import UserError


def _rotors(lengths):
    """A still part and two that slide, each by its own clip."""
    glb = triangle()
    glb.tree["nodes"] = [{"name": "body", "mesh": 0}, {"mesh": 0}, {"mesh": 0}]
    glb.tree["scenes"] = [{"nodes": [0, 1, 2]}]
    for node, seconds in enumerate(lengths, start=1):
        animate(glb, "translation", [0, seconds], [[0, 0, 0], [8, 0, 0]], node=node)
    return glb


def test_one_clip_a_rotor_plays_together(tmp_path):
    """The shorter one goes round and jumps back where it does not close; clips of nodes that move already wait."""
    glb = _rotors((4.0, 1.0))
    animate(glb, "translation", [0, 9], [[0, 0, 0], [0, 0, 90]], node=2)
    glb.write(tmp_path / "a.glb")
    mesh = import_model(tmp_path, "a.glb")
    assert mesh.cycle_seconds == pytest.approx(4.0)
    for seconds, first, second in ((0.5, 1.0, 4.0), (2.25, 4.5, 2.0), (2.999, 5.998, 7.992), (3.75, 7.5, 6.0)):
        assert relative(mesh, seconds)[[3, 6], 0] == pytest.approx([first, second], abs=1e-3)
        assert relative(mesh, seconds)[:, 2] == pytest.approx(0.0)
    alone = import_model(tmp_path, "a.glb", "scale: 1.0, forward: +X, up: +Z, animation: 0")
    assert relative(alone, 2.0)[[3, 6], 0] == pytest.approx([4.0, 0.0])


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"interpolation": "SPHERICAL"}, "has the interpolation 'SPHERICAL'"),
        ({"input": [[1.0], [0.0]]}, "times are none, or not in order"),
        ({"input": [[0.0], [float("nan")]]}, "holds values that are not finite"),
        ({"input": [[0.0], [1.0], [2.0]]}, "2 values do not fit 3 times"),
        ({"output": [[0.0], [1.0]]}, "of type SCALAR, not VEC3"),
        ({"input": [[0.0], [1e9]]}, r"holds 1e\+09 seconds of animation, more than 3600"),
    ],
)
def test_clips_that_contradict_themselves_are_named(tmp_path, fields, message):
    glb = _rotors((1.0,))
    sampler = glb.tree["animations"][0]["samplers"][0]
    sampler |= {k: glb.add(v) if isinstance(v, list) else v for k, v in fields.items()}
    with pytest.raises(UserError, match=message):
        import_model(tmp_path, glb.write(tmp_path / "a.glb"))


def test_rotations_that_are_zero_and_pointers_are_named(tmp_path):
    glb = triangle()
    animate(glb, "rotation", [0, 1], [[0, 0, 0, 0], [0, 0, 0, 1]])
    with pytest.raises(UserError, match="a rotation is zero"):
        import_model(tmp_path, glb.write(tmp_path / "a.glb"))
    pointer = {"KHR_animation_pointer": {"pointer": "/nodes/0/rotation"}}
    glb.tree["animations"][0]["channels"][0]["target"] = {"path": "pointer", "extensions": pointer}
    with pytest.raises(UserError, match="moves /nodes/0/rotation by KHR_animation_pointer, which is not read"):
        import_model(tmp_path, glb.write(tmp_path / "a.glb"))
    assert np.isfinite(import_model(tmp_path, "a.glb", "scale: 1.0, forward: +X, up: +Z, animation: none").faces).all()
