"""Normals: flat across creases, smooth within them."""

from __future__ import annotations

import numpy as np
import pytest

from aerojax.simulate.assets.mesh.parts import corner_normals, face_normals
from aerojax.simulate.assets.mesh.shapes import box, ellipsoid


def test_face_normals_are_twice_the_areas():
    cube = box((0.0, 0.0, 0.0), (2.0, 2.0, 2.0))
    assert np.abs(face_normals(cube)).sum(axis=1) == pytest.approx(4.0)
    assert face_normals(cube).sum(axis=0) == pytest.approx(0.0, abs=1e-12)


def test_a_box_keeps_its_edges():
    cube = box((0.0, 0.0, 0.0), (1.0, 2.0, 3.0))
    flat = face_normals(cube)
    flat = flat / np.linalg.norm(flat, axis=1, keepdims=True)
    assert corner_normals(cube) == pytest.approx(np.repeat(flat, 3, axis=0))


def test_a_sphere_is_smooth():
    sphere = ellipsoid((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), 24, 24)
    outward = sphere.points[sphere.faces.reshape(-1)]
    assert np.abs(corner_normals(sphere) - outward).max() < 0.1
    flat = np.repeat(face_normals(sphere), 3, axis=0)
    flat = flat / np.linalg.norm(flat, axis=1, keepdims=True)
    assert np.abs(flat - outward).max() > 0.1
