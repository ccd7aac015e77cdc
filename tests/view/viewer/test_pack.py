"""Gaussians as text: what comes out is what went in, to half floats and bytes."""

from __future__ import annotations

import base64
import dataclasses

import numpy as np
import pytest
from support.report_examples import make_splats

from aerojax.view.viewer.pack import BYTES_PER_SPLAT, pack_splats, reach


def unpacked(text: str) -> tuple[np.ndarray, np.ndarray]:
    data = base64.b64decode(text)
    count = len(data) // 24
    halves = np.frombuffer(data[: 20 * count], "<f2").reshape(count, 10)
    return halves.astype(np.float32), np.frombuffer(data[20 * count :], np.uint8).reshape(count, 4)


def test_what_is_packed_can_be_read():
    splats = make_splats(100, 0)
    text = pack_splats(splats, 100)
    assert len(text) == 100 * BYTES_PER_SPLAT
    halves, levels = unpacked(text)
    np.testing.assert_allclose(halves[:, :3], splats.mean, rtol=1e-3, atol=1e-6)
    np.testing.assert_allclose(halves[:, 3:7], splats.quaternion, rtol=1e-3, atol=1e-6)
    np.testing.assert_allclose(halves[:, 7:], splats.scale, rtol=1e-3)
    np.testing.assert_allclose(levels[:, :3] / 255, splats.rgb, atol=0.51 / 255)
    np.testing.assert_allclose(levels[:, 3] / 255, splats.opacity, atol=0.51 / 255)


def test_what_cannot_be_drawn_is_left_out_and_the_rest_thinned():
    splats = make_splats(90, 0)
    mean, opacity = splats.mean.copy(), splats.opacity.copy()
    mean[3], mean[4, 1], opacity[5] = np.nan, 1e6, np.inf
    broken = dataclasses.replace(splats, mean=mean, opacity=opacity)
    assert len(unpacked(pack_splats(broken, 1000))[0]) == 87
    few = unpacked(pack_splats(broken, 10))[0]
    assert len(few) == 10
    np.testing.assert_allclose(few[[0, -1], :3], splats.mean[[0, -1]], rtol=1e-3, atol=1e-6)
    assert pack_splats(dataclasses.replace(broken, mean=np.full_like(mean, np.nan)), 10) == ""


def test_reach_ignores_strays():
    splats = make_splats(1000, 1)
    mean = splats.mean.copy()
    mean[5], mean[6] = 1e4, np.inf
    assert 0.4 < reach([dataclasses.replace(splats, mean=mean)]) < 0.8
    assert reach([]) == pytest.approx(1.15)


def test_24_frames_of_1024_fit_a_megabyte():
    assert 24 * len(pack_splats(make_splats(1024, 0), 4096)) <= 1_000_000
