"""Conversion of a model: axes, scale, and when it is made again."""

from __future__ import annotations

import numpy as np
import pytest
from support.gltf_files import triangle
from support.model_imports import centred, import_model


def test_axes_and_scale(tmp_path):
    """The default axes of glTF, nose +Z and up +Y, so that its +X is the body's left, +Y."""
    triangle().write(tmp_path / "a.glb")
    mesh = import_model(tmp_path, "a.glb", "scale: 0.5")
    assert mesh.vertices_at(0.0) == pytest.approx(centred([[0, 0, 0], [0, 1, 0], [0, 0, 0.5]]), abs=1e-7)
    assert mesh.faces.tolist() == [[0, 1, 2]] and mesh.cycle_seconds == 0.0
    mesh = import_model(tmp_path, "a.glb", "scale: auto")
    assert np.ptp(mesh.vertices_at(0.0)[:, 1]) == pytest.approx(1.0)


def test_changed_list_converts_again(tmp_path):
    triangle().write(tmp_path / "a.glb")
    before = import_model(tmp_path, "a.glb", "scale: 1.0, forward: +X, up: +Z").vertices_at(0.0)
    kept = (tmp_path / "assets" / "model.usdc").stat().st_mtime_ns
    import_model(tmp_path, "a.glb", "scale: 1.0, forward: +X, up: +Z")
    assert (tmp_path / "assets" / "model.usdc").stat().st_mtime_ns == kept
    after = import_model(tmp_path, "a.glb", "scale: 3.0, forward: +X, up: +Z").vertices_at(0.0)
    assert after == pytest.approx(3 * before, abs=1e-6)
