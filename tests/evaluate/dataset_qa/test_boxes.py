"""Sub-pixel boxes of exact silhouettes, and overlaps by hand."""

from __future__ import annotations

import numpy as np
import pytest

from aerojax.evaluate.dataset_qa.boxes import NOWHERE, box_overlaps, clip_boxes, subpixel_box


def rectangle(x0: float, y0: float, x1: float, y1: float, rows: int = 12, columns: int = 16) -> np.ndarray:
    """Exact coverage of an axis-aligned rectangle."""

    def shares(low: float, high: float, count: int) -> np.ndarray:
        cells = np.arange(count)
        return (np.minimum(cells + 1, high) - np.maximum(cells, low)).clip(0.0, 1.0)

    return np.outer(shares(y0, y1, rows), shares(x0, x1, columns))


@pytest.mark.parametrize("box", [(3.25, 2.5, 9.75, 8.0), (0.0, 0.0, 16.0, 12.0), (4.9, 3.4, 12.1, 3.7)])
def test_subpixel_box_of_a_rectangle_is_exact(box):
    found = subpixel_box(rectangle(*box))
    np.testing.assert_allclose(found[[0, 2]], [box[0], box[2]], atol=1e-9)
    if box[3] - box[1] > 1:
        np.testing.assert_allclose(found[[1, 3]], [box[1], box[3]], atol=1e-9)
    else:  # within one row nothing says where in it the sliver lies
        np.testing.assert_allclose(found[[1, 3]], [3.0, 4.0])


def test_subpixel_box_of_nothing():
    assert np.isnan(subpixel_box(np.zeros((3, 3)))).all()


def test_overlaps_by_hand():
    one = np.array([[0.0, 0, 2, 2], [0, 0, 2, 2], [0, 0, 1, 1], list(NOWHERE)])
    other = np.array([[1.0, 1, 3, 3], [0, 0, 2, 2], [5, 5, 6, 6], [0, 0, 1, 1]])
    np.testing.assert_allclose(box_overlaps(one, other), [1 / 7, 1.0, 0.0, np.nan])
    clipped = clip_boxes(np.array([[-5.0, 2.0, 700.0, 500.0]]), np.array([[640.0, 360.0]]))
    np.testing.assert_allclose(clipped, [[0.0, 2.0, 640.0, 360.0]])
