"""Outlines of masks: hulls of what is whole and uncovered, in the order of the detections."""

from __future__ import annotations

import numpy as np
import pytest

from aerojax.track.adjust import outlines
from aerojax.track.masks import whole_instances


@pytest.fixture
def mask() -> np.ndarray:
    """A square, an L, something at the border and two that touch."""
    ids = np.zeros((60, 80), np.uint16)
    ids[5:10, 5:10] = 1
    ids[20:30, 20:22] = 2
    ids[28:30, 20:30] = 2
    ids[50:60, 0:10] = 3
    ids[40:46, 40:46] = 4
    ids[40:46, 46:52] = 5
    return ids


def test_hulls_of_what_is_whole_and_uncovered(mask):
    found = {number: outlines._outline(mask, number, box) for number, box in whole_instances(mask)}
    assert sorted(found) == [1, 2, 4, 5]  # what touches the border is not whole
    assert {tuple(corner) for corner in found[1]} == {(5.5, 5.5), (9.5, 5.5), (5.5, 9.5), (9.5, 9.5)}
    assert (29.5, 28.5) in {tuple(corner) for corner in found[2]} and (22.5, 27.5) not in map(tuple, found[2])
    assert len(found[4]) == len(found[5]) == 0
