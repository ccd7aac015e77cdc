"""UsdGeom's shapes against their volumes and bounds."""

from __future__ import annotations

import numpy as np
import pytest
from support.usd_text import write_usda

from aerojax.core.errors import UserError
from aerojax.simulate.usd.animated_mesh import load_animated_mesh


def _load(folder, text):
    return load_animated_mesh(write_usda(folder / "a.usda", text))


def _volume(mesh, seconds=0.0):
    """Signed: positive where faces look outwards and the surface is closed."""
    a, b, c = np.moveaxis(mesh.vertices_at(seconds).astype(float)[mesh.faces], 1, 0)
    return float(np.einsum("fx,fx->", a, np.cross(b, c)) / 6)


@pytest.mark.parametrize(
    ("shape", "numbers", "volume", "low", "high"),
    [
        ("Cube", {"size": 3}, 27, (-1.5, -1.5, -1.5), (1.5, 1.5, 1.5)),
        ("Cube", {}, 8, (-1, -1, -1), (1, 1, 1)),
        ("Sphere", {"radius": 2}, 32 * np.pi / 3, (-2, -2, -2), (2, 2, 2)),
        ("Cylinder", {"radius": 2, "height": 6}, 24 * np.pi, (-2, -2, -3), (2, 2, 3)),
        ("Cylinder", {"radius": 2, "height": 6, "axis": "X"}, 24 * np.pi, (-3, -2, -2), (3, 2, 2)),
        ("Cylinder", {}, 2 * np.pi, (-1, -1, -1), (1, 1, 1)),
        ("Cone", {"radius": 2, "height": 6, "axis": "Y"}, 8 * np.pi, (-2, -3, -2), (2, 3, 2)),
        ("Capsule", {"radius": 2, "height": 6}, 24 * np.pi + 32 * np.pi / 3, (-2, -2, -5), (2, 2, 5)),
        ("Capsule", {"axis": "X"}, np.pi * (1 / 4 + 1 / 6), (-1, -0.5, -0.5), (1, 0.5, 0.5)),
        ("Cylinder_1", {"radiusTop": 1, "radiusBottom": 2, "height": 3}, 7 * np.pi, (-2, -2, -1.5), (2, 2, 1.5)),
    ],
)
def test_shapes_have_their_volume_and_bounds(tmp_path, shape, numbers, volume, low, high):
    lines = [f'uniform token axis = "{v}"' if k == "axis" else f"double {k} = {v}" for k, v in numbers.items()]
    mesh = _load(tmp_path, f'def {shape} "a" {{\n' + "\n".join(lines) + "\n}")
    assert _volume(mesh) == pytest.approx(volume, rel=5e-3)
    assert mesh.vertices_at(0.0).min(0) == pytest.approx(low, abs=1e-6)
    assert mesh.vertices_at(0.0).max(0) == pytest.approx(high, abs=1e-6)


@pytest.mark.parametrize("axis", ["X", "Y", "Z"])
def test_planes_face_along_their_axis(tmp_path, axis):
    """Width along x (z where the axis is X), length along y (z where the axis is Y)."""
    mesh = _load(tmp_path, f'def Plane "a" {{ double width = 4; double length = 6; uniform token axis = "{axis}" }}')
    size = {"X": (0, 6, 4), "Y": (4, 0, 6), "Z": (4, 6, 0)}[axis]
    assert np.ptp(mesh.vertices_at(0.0), axis=0) == pytest.approx(size)
    a, b, c = mesh.vertices_at(0.0)[mesh.faces[0]]
    assert np.cross(b - a, c - a) == pytest.approx(24 * np.eye(3)["XYZ".index(axis)])


def test_shapes_follow_their_samples_colours_and_handedness(tmp_path):
    """The radius grows from 1 to 3; both shapes are grey 0.2; the left-handed one looks inwards."""
    colour = "color3f[] primvars:displayColor = [(0.2, 0.2, 0.2)]"
    mesh = _load(
        tmp_path,
        f'def Sphere "a" {{ double radius.timeSamples = {{ 0: 1, 24: 3 }} ; {colour} }} '
        f'def Cube "b" {{ uniform token orientation = "leftHanded"; {colour} }}',
    )
    assert mesh.cycle_seconds == 1.0 and mesh.vertices_at(0.5)[:, 0].max() == pytest.approx(2.0)
    assert _volume(mesh, 0.5) == pytest.approx(32 * np.pi / 3 - 8, rel=5e-3)
    assert mesh.albedo == pytest.approx(1.055 * 0.2 ** (1 / 2.4) - 0.055, abs=1e-6)


def test_lengths_that_are_none_are_named(tmp_path):
    with pytest.raises(UserError, match=r"a\.usda: /a: radius is -1\.0; give a length that is not negative"):
        _load(tmp_path, 'def Sphere "a" { double radius = -1 }')
