"""Clouds, outlines and images in the few bytes that a page can hold."""

from __future__ import annotations

import base64
import re

import cv2
import numpy as np
import pytest

from aerojax.view.encode import cloud_radius, jpeg_uri, jpegs_within, mask_box, mask_outline, pack_cloud


def test_clouds_are_packed_within_a_step_of_quantisation():
    points = np.random.default_rng(1).uniform(-1, 1, (200, 3)).astype(np.float32) + np.float32(40)
    colours = np.arange(600, dtype=np.uint32).astype(np.uint8).reshape(200, 3)
    packed = pack_cloud(points, colours, 2.0, 500)
    xyz = np.frombuffer(base64.b64decode(packed["xyz"]), "<i2").reshape(-1, 3) / 32767 * 2.0
    np.testing.assert_allclose(xyz, points - np.median(points, axis=0), atol=2.0 / 32767)
    np.testing.assert_array_equal(np.frombuffer(base64.b64decode(packed["rgb"]), np.uint8).reshape(-1, 3), colours)
    assert packed["count"] == 200


def test_clouds_are_thinned_and_outliers_left_out():
    points = np.random.default_rng(1).normal(size=(1000, 3)).astype(np.float32)
    points[5] = 1e6
    points[6] = np.inf
    radius = cloud_radius([points])
    assert 2.0 < radius < 4.0
    packed = pack_cloud(points, np.zeros((1000, 3), np.uint8), radius, 100)
    assert len(base64.b64decode(packed["xyz"])) == 600 and packed["count"] == 1000
    empty = pack_cloud(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint8), radius, 100)
    assert empty == {"xyz": "", "rgb": "", "count": 0}
    assert cloud_radius([]) == pytest.approx(1.15)


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
