"""Points on surfaces, and embeddings that see shape alone."""

from __future__ import annotations

import numpy as np
import pytest

from aerojax.evaluate.dataset_qa.shapes import draw_surface_points, face_areas, shape_embedding

CUBE = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])


CUBE_FACES = np.array(
    [
        *([0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]),
        *([2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]),
    ]
)


def test_surface_points_are_uniform_over_the_area():
    points = draw_surface_points(CUBE, CUBE_FACES, 6000, np.random.default_rng(0)).at(CUBE, CUBE_FACES)
    assert face_areas(CUBE, CUBE_FACES).sum() == pytest.approx(6.0)
    on_face = np.stack([np.abs(points - side) < 1e-12 for side in (0.0, 1.0)]).sum(axis=1)
    np.testing.assert_allclose(on_face, 1000, atol=150)
    np.testing.assert_allclose(points.mean(axis=0), 0.5, atol=0.02)


def embedding_of(vertices: np.ndarray, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    points = draw_surface_points(vertices, CUBE_FACES, 8000, rng).at(vertices, CUBE_FACES)
    return shape_embedding(points[None], float(face_areas(vertices, CUBE_FACES).sum()), rng)


def test_embedding_does_not_see_rotation_and_scale_but_shape():
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    slab = CUBE * [1.0, 0.7, 0.2]
    plain, same, turned, other = (
        embedding_of(v, s) for v, s in ((slab, 0), (slab, 1), (5.0 * slab @ turn.T, 0), (CUBE, 0))
    )
    np.testing.assert_allclose(plain, turned, atol=1e-9)
    assert np.linalg.norm(plain - same) < 0.03
    assert np.linalg.norm(plain - other) > 0.2  # the negative control
