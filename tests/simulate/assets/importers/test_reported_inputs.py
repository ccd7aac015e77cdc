"""Small inputs made after public bug reports: the right value of each, or the right refusal."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.model_imports import import_model

from aerojax.core.errors import UserError
from aerojax.simulate.usd.animated_mesh import load_animated_mesh

INPUTS = Path(__file__).resolve().parents[5] / "shared" / "bugs"
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
