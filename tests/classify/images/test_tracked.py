"""A tracker carries labels over frames without a detection, and is begun anew by each detection."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from aerojax.classify.images.tracked import bridged, csrt_trackers, followed
from aerojax.core.errors import UserError

BEGUN: list[tuple[int, int, int, int]] = []


class ToyTracker:
    """Follows for two frames; `BEGUN` remembers what with."""

    def init(self, image, box):
        self.left = 2
        BEGUN.append(box)

    def update(self, image):
        self.left -= 1
        return self.left >= 0, None


IMAGES = np.zeros((7, 20, 30, 3), np.uint8)
BOX = np.tile(np.array([2.2, 3.0, 9.1, 8.0], np.float32), (7, 1))
LABEL, CONFIDENCE = np.array([3, 1, 2, 0, 0, 0, 2]), np.linspace(0.1, 0.7, 7).astype(np.float32)


def test_labels_are_carried_while_the_tracker_follows():
    BEGUN.clear()
    detected = np.array([False, True, False, False, False, False, True])
    label, confidence, known = bridged(IMAGES, BOX, LABEL, CONFIDENCE, detected, ToyTracker)
    np.testing.assert_array_equal(known, [False, True, True, True, False, False, True])
    np.testing.assert_array_equal(label[known], [1, 1, 1, 2])
    np.testing.assert_array_equal(confidence[known], CONFIDENCE[[1, 1, 1, 6]])
    assert BEGUN == [(2, 3, 8, 5)] * 2


def test_boxes_too_small_or_outside_begin_no_track():
    box = BOX.copy()
    box[0], box[2] = [5, 5, 6, 6], [-9, -9, -3, -3]
    detected = np.array([True, False, True, False, True, False, False])
    _, _, known = bridged(IMAGES, box, LABEL, CONFIDENCE, detected, ToyTracker)
    np.testing.assert_array_equal(known, [True, False, True, False, True, True, True])


def test_cameras_are_followed_apart():
    detected = np.array([True, True, False, False, False, False, False])
    label, _, known = followed(
        IMAGES, BOX, LABEL, CONFIDENCE, detected, camera=np.array([0, 1, 0, 1, 0, 1, 0]), make=ToyTracker
    )
    np.testing.assert_array_equal(label[:6], [3, 1, 3, 1, 3, 1])
    np.testing.assert_array_equal(known, [True] * 6 + [False])


def test_opencv_without_csrt_says_what_is_missing():
    if hasattr(cv2, "TrackerCSRT") or hasattr(cv2, "TrackerCSRT_create"):
        pytest.skip("this OpenCV has CSRT")
    with pytest.raises(UserError, match="opencv-contrib-python-headless") as error:
        csrt_trackers()
    assert error.value.code == "unavailable"


def test_csrt_follows_a_square():
    """In an environment of its own, with opencv-contrib-python-headless."""
    if not (hasattr(cv2, "TrackerCSRT") or hasattr(cv2, "TrackerCSRT_create")):
        pytest.skip("this OpenCV has no CSRT")
    images = np.random.default_rng(0).integers(90, 110, (4, 80, 120, 3)).astype(np.uint8)
    for number in range(4):
        images[number, 30:50, 30 + 4 * number : 50 + 4 * number] = 240
    box = np.tile(np.array([30, 30, 50, 50], np.float32), (4, 1))
    detected = np.array([True, False, False, False])
    label, _, known = bridged(images, box, LABEL[:4], CONFIDENCE[:4], detected, csrt_trackers())
    assert known.all() and (label == LABEL[0]).all()
