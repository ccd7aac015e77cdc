"""Boxes in space by hand-computed numbers, and as the smallest of their kind."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from aerojax.geometry.boxes_3d import CORNER_SIGNS, AlignedBox, OrientedBox, aligned_box, box_corners, oriented_box

QUARTER = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""x to y, y to -x."""


def test_boxes_by_hand():
    points = np.array([[1.0, 2.0, 3.0], [5.0, 4.0, 3.5]])
    assert aligned_box(points) == AlignedBox((1.0, 2.0, 3.0), (5.0, 4.0, 3.5))
    assert oriented_box(points, QUARTER) == OrientedBox((3.0, 3.0, 3.25), (2.0, 4.0, 0.5))
    corners = box_corners(OrientedBox((3.0, 3.0, 3.25), (2.0, 4.0, 0.5)), QUARTER)
    # The first corner is the lowest along the body's axes: x_body = y_world, y_body = -x_world.
    np.testing.assert_allclose(corners[[0, 1, 2, 4]], [[5, 2, 3], [5, 2, 3.5], [1, 2, 3], [5, 4, 3]], atol=1e-12)


def test_an_oriented_box_is_tight_and_turns_with_its_body():
    rng = np.random.default_rng(4)
    body, turn = rng.normal(size=(60, 3)) * (1.0, 0.3, 0.1), Rotation.random(random_state=rng).as_matrix()
    world = body @ turn.T + (10.0, -20.0, 30.0)
    box = oriented_box(world, turn)
    inside = (world - np.array(box.centre)) @ turn / (np.array(box.size) / 2)
    np.testing.assert_allclose(np.abs(inside).max(axis=0), 1.0, atol=1e-12)
    np.testing.assert_allclose(inside.min(axis=0), -1.0, atol=1e-12)
    np.testing.assert_allclose(box.size, np.ptp(body, axis=0), atol=1e-12)
    signs = np.sign((box_corners(box, turn) - np.array(box.centre)) @ turn)
    np.testing.assert_array_equal(signs, CORNER_SIGNS)
    assert np.prod(np.subtract(aligned_box(world).high, aligned_box(world).low)) > np.prod(box.size)
