"""Outlines and images in the few bytes that a page can hold."""

from __future__ import annotations

import base64
import re

import cv2
import numpy as np

from aerojax.view.encode import data_uri, jpeg_uri, jpegs_within, mask_box, mask_outline


def test_outline_and_box_of_a_mask():
    mask = np.zeros((20, 30), bool)
    assert mask_outline(mask) == "" and mask_box(mask) is None
    mask[4:9, 10:16] = True
    assert mask_box(mask) == [10, 4, 16, 9]
    corners = {tuple(map(float, pair.split())) for pair in re.split("[MLZ]", mask_outline(mask)) if pair}
    assert corners == {(10.5, 4.5), (15.5, 4.5), (15.5, 8.5), (10.5, 8.5)}
    specks = np.random.default_rng(0).random((80, 80)) > 0.6
    assert 0 < len(mask_outline(specks, 300)) <= 300


def test_images_shrink_to_the_budget():
    image = np.random.default_rng(0).integers(0, 256, (300, 200, 3), dtype=np.uint8)
    generous, tight = jpegs_within([image] * 3, 10**7), jpegs_within([image] * 3, 30_000)
    assert sum(map(len, tight)) <= 30_000 < sum(map(len, generous))
    decoded = cv2.imdecode(np.frombuffer(base64.b64decode(jpeg_uri(image, 150, 80).partition(",")[2]), np.uint8), 1)
    assert decoded.shape == (150, 100, 3)


def test_transparency_survives_a_uri():
    bgra = np.zeros((6, 5, 4), np.uint8)
    bgra[2:4, 1:3] = (255, 128, 0, 200)
    uri = data_uri(bgra, "png", [])
    assert uri.startswith("data:image/png;base64,")
    read = cv2.imdecode(np.frombuffer(base64.b64decode(uri.partition(",")[2]), np.uint8), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(read, bgra)
