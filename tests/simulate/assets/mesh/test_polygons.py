"""Polygons against areas by hand: convex, concave, tilted, either winding, crossing."""

from __future__ import annotations

import numpy as np
import pytest

from aerojax.simulate.assets.mesh.polygons import triangulate

L = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]
U = [(0, 0), (3, 0), (3, 2), (2, 2), (2, 1), (1, 1), (1, 2), (0, 2)]
STAR = [(np.cos(a) * r, np.sin(a) * r) for a, r in zip(np.arange(10) * np.pi / 5, [1, 0.3] * 5, strict=True)]
TILT = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]


def _area_vectors(points, corners, vertices):
    a, b, c = (points[vertices[corners[:, k]]] for k in range(3))
    return np.cross(b - a, c - a) / 2


@pytest.mark.parametrize(("shape", "area"), [(L, 3.0), (U, 5.0), (STAR, 5 * 0.3 * np.sin(np.pi / 5))])
@pytest.mark.parametrize("first", range(3))
@pytest.mark.parametrize("turned", [False, True])
def test_concave_faces_keep_their_area_and_winding(shape, area, first, turned):
    """The shape between a triangle and a square, from any first corner, either way round, on any plane."""
    outline = np.roll(np.array(shape, float), first, axis=0)[:: -1 if turned else 1]
    flat = np.concatenate([[(0, 0), (1, 0), (0, 1)], outline, [(0, 0), (1, 0), (1, 1), (0, 1)]])
    points = np.column_stack([flat, np.full(len(flat), 0.5)]) @ TILT.T + 7
    counts, vertices = np.array([3, len(outline), 4]), np.arange(len(flat))
    corners, polygon = triangulate(points, counts, vertices)
    assert polygon.tolist() == [0] + [1] * (len(outline) - 2) + [2, 2]
    up = _area_vectors(points, corners, vertices) @ TILT[:, 2]
    assert (up[polygon == 1] * (-1 if turned else 1) > 0).all()
    assert [np.abs(up[polygon == p]).sum() for p in range(3)] == pytest.approx([0.5, area, 1.0])


def test_convex_faces_are_fans_of_their_first_corner():
    points = np.array([[np.cos(a), np.sin(a), 0] for a in np.arange(5) * 2 * np.pi / 5])
    corners, polygon = triangulate(points, np.array([5, 2, 0, 4]), np.array([0, 1, 2, 3, 4, 0, 1, 4, 3, 2, 1]))
    assert corners.tolist() == [[0, 1, 2], [0, 2, 3], [0, 3, 4], [7, 8, 9], [7, 9, 10]]
    assert polygon.tolist() == [0, 0, 0, 3, 3]


@pytest.mark.parametrize("shape", [[(0, 0), (1, 1), (1, 0), (0, 1)], [(0, 0)] * 4, [(0, 0), (1, 0), (2, 0), (3, 0)]])
def test_faces_that_cross_themselves_or_have_no_area_become_fans(shape):
    points = np.column_stack([np.array(shape, float), np.zeros(4)])
    corners, _ = triangulate(points, np.array([4]), np.arange(4))
    assert corners.tolist() == [[0, 1, 2], [0, 2, 3]]
