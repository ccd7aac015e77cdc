"""The rasteriser: known coverage, nearer faces win, colours average."""

from __future__ import annotations

import numpy as np

from kernels.rays.raster import rasterise

RED, BLUE = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)


def square(x0: float, y0: float, x1: float, y1: float, depth: float) -> np.ndarray:
    return np.array([[x0, y0, depth], [x1, y0, depth], [x1, y1, depth], [x0, y1, depth]])


def test_coverage_is_the_share_of_samples():
    coverage, colour, depth = rasterise(
        square(0.5, 1.0, 2.0, 2.0, 5.0), np.array([[0, 1, 2], [0, 2, 3]]), np.array([RED, RED]), (3, 3), 4
    )
    np.testing.assert_allclose(coverage, [[0, 0, 0], [0.5, 1, 0], [0, 0, 0]])
    np.testing.assert_allclose(colour[1, :2], [RED, RED])
    assert not colour[0].any() and not depth[0].any()
    np.testing.assert_allclose(depth[1, :2], 5.0)


def test_the_nearer_face_is_seen_whatever_the_order():
    points = np.concatenate([square(0.0, 0.0, 2.0, 2.0, 5.0), square(0.0, 0.0, 1.5, 2.0, 4.0)])
    faces = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    for order in ([0, 1, 2, 3], [2, 3, 0, 1], [3, 0, 2, 1]):
        colours = np.array([RED, RED, BLUE, BLUE])[order]
        coverage, colour, depth = rasterise(points, faces[order], colours, (2, 2), 2)
        np.testing.assert_allclose(coverage, np.ones((2, 2)))
        np.testing.assert_allclose(colour[0], [BLUE, (0.5, 0.0, 0.5)])
        np.testing.assert_allclose(depth[0], [4.0, 2 / (1 / 4 + 1 / 5)], rtol=1e-6)


def test_faces_reach_beyond_the_window_and_turn_either_way():
    points = square(-5.0, -5.0, 9.0, 9.0, 3.0)
    for faces in ([[0, 1, 2], [0, 2, 3]], [[2, 1, 0], [3, 2, 0]]):
        coverage, *_ = rasterise(points, np.array(faces), np.array([RED, RED]), (3, 2), 3)
        np.testing.assert_allclose(coverage, np.ones((2, 3)))
