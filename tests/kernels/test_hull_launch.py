"""Signed distances, thinning and the grid's field of the hull's kernels."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt

from kernels.hull.launch import REACH, Grid, Silhouettes, hull_distances, hull_surface, thinned

SIZE = 40


def silhouettes(mask):
    """Cameras 10 m up and down one axis that see a cube of 4 m."""
    views = len(mask)
    K = np.array([[10.0 * SIZE / 4, 0, SIZE / 2], [0, 10.0 * SIZE / 4, SIZE / 2], [0, 0, 1]], np.float32)
    rows = np.tile(np.eye(3, 4, dtype=np.float32), (views, 1, 1))
    rows[:, 2, 3] = 10.0
    centres = np.tile(np.array([0, 0, -10], np.float32), (views, 1))
    rgb = np.full((views, SIZE, SIZE, 3), 0.25, np.float32)
    return Silhouettes(rgb, mask.astype(np.float32), np.tile(K, (views, 1, 1)), rows, centres)


def expected_distance(inside):
    def to(target):
        return np.minimum(distance_transform_edt(~target) if target.any() else REACH, REACH)

    return np.where(inside, to(~inside) - 0.5, 0.5 - to(inside))


@pytest.mark.parametrize("share", [0.0, 0.002, 0.05, 0.5, 0.95, 1.0])
def test_distances_are_euclidean(share):
    mask = np.random.default_rng(3).random((3, SIZE, SIZE)) < share
    found = hull_distances(silhouettes(mask))
    np.testing.assert_allclose(found, np.stack([expected_distance(m) for m in mask]), atol=1e-5)


def test_a_disc_leaves_a_cone_of_its_radius():
    along = np.arange(SIZE) + 0.5 - SIZE / 2
    disc = np.hypot(along[:, None], along[None]) < 8
    found = hull_surface(silhouettes(disc[None]), Grid(32, 4.4 / 32, 8192, 0.0))
    radius = np.hypot(found.mean[:, 0], found.mean[:, 1]) / (10 + found.mean[:, 2]) * 10
    np.testing.assert_allclose(radius, 0.8, atol=0.1)  # 8 pixels of 0.1 m at 10 m
    np.testing.assert_allclose(found.colour, 0.25, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(found.quaternion, axis=1), 1.0, atol=1e-6)


def test_no_silhouette_leaves_nothing():
    assert len(hull_surface(silhouettes(np.zeros((2, SIZE, SIZE))), Grid(16, 0.3, 64, 0.35)).mean) == 0


def test_thinning_is_even_and_keeps_order():
    cells = np.arange(1000) * 3
    np.testing.assert_array_equal(thinned(cells, 1000), cells)
    kept = thinned(cells, 256)
    assert kept.size == 256 and kept[0] == 0 and set(np.diff(kept) // 3) == {3, 4}
