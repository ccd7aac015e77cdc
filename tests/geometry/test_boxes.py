"""Boxes by hand-computed numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from aerojax.geometry.boxes import box_iou, projected_box, tight_box, touches_border


@dataclass(frozen=True)
class HostCamera:
    """A pinhole of host arrays, as cameras of captures are."""

    K: np.ndarray
    world_from_cam: np.ndarray


def host_camera(world_from_cam=None):
    K = np.array([[100.0, 0.0, 32.0], [0.0, 200.0, 24.0], [0.0, 0.0, 1.0]])
    return HostCamera(K, np.eye(4) if world_from_cam is None else world_from_cam)


def test_projected_box_by_hand():
    points = np.array([[0.0, 0.0, 5.0], [1.0, -0.5, 4.0]])
    assert projected_box(points, host_camera()) == (32.0, -1.0, 57.0, 24.0)
    assert projected_box(-points, host_camera()) is None


def test_boxes():
    mask = np.zeros((6, 8), bool)
    assert tight_box(mask) is None
    mask[2:4, 3:7] = True
    assert tight_box(mask) == (3.0, 2.0, 7.0, 4.0)
    assert tight_box(mask, min_pixels=9) is None
    assert box_iou((0.0, 0.0, 2.0, 2.0), (1.0, 1.0, 3.0, 3.0)) == pytest.approx(1 / 7)
    assert box_iou((0.0, 0.0, 1.0, 1.0), (1.0, 0.0, 2.0, 1.0)) == 0.0
    assert box_iou((0.0, 0.0, 1.0, 1.0), (5.0, 5.0, 6.0, 6.0)) == 0.0
    assert not touches_border((1.0, 1.0, 7.0, 5.0), 8, 6)
    for box in ((0.0, 1.0, 7.0, 5.0), (1.0, 0.0, 7.0, 5.0), (1.0, 1.0, 8.0, 5.0), (1.0, 1.0, 7.0, 6.0)):
        assert touches_border(box, 8, 6)
