"""Sizes by class, where no scale is given."""

from __future__ import annotations

import numpy as np
import pytest
from support.gltf_files import triangle
from support.model_imports import import_model

from aerojax.core.errors import UserError


def test_drone_without_motors_needs_a_scale(tmp_path):
    triangle().write(tmp_path / "a.glb")
    with pytest.raises(
        UserError, match=r"a\.glb: scale: auto does not find the distance between its motors; give scale"
    ):
        import_model(tmp_path, "a.glb", "scale: auto", label="drone")


def test_static_drone_is_measured_between_named_rotors(tmp_path):
    corners = [(x, y) for x in (-3, 3) for y in (-4, 4)]
    rows = [
        f"o rotor_{i}\nv {x} {y} 0\nv {x + 1} {y} 0\nv {x} {y + 1} 0\nf -3 -2 -1\n" for i, (x, y) in enumerate(corners)
    ]
    (tmp_path / "model.obj").write_text("".join(rows))
    mesh = import_model(tmp_path, "model.obj", "forward: +X, up: +Z", label="drone")
    assert np.ptp(mesh.vertices_at(0.0), axis=0) == pytest.approx([0.7, 0.9, 0])
