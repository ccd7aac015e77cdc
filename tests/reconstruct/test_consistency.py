"""How well cameras agree in one frame: nothing is off where they do, and what is off is measured."""

from __future__ import annotations

import numpy as np
import pytest
from support.disagreeing_cameras import observed, turned
from support.networks import AXES, FOCAL, frame_sets, network, position_at

from aerojax.capture.format import CaptureCamera
from aerojax.core.types import FrameSet
from aerojax.reconstruct.consistency import Consistency, consistency, uncovered_share, uncovered_shares

CAMERAS = network()
FRAME = next(iter(frame_sets(CAMERAS, range(1))))
PIXEL = 5 / FOCAL
"""Metres at the object, about."""


def ellipsoid(count: int = 4000) -> np.ndarray:
    """Points all over its surface."""
    directions = np.random.default_rng(0).normal(size=(count, 3))
    return AXES * directions / np.linalg.norm(directions, axis=1, keepdims=True)


def figures(frame: FrameSet, cameras: tuple[CaptureCamera, ...]) -> Consistency:
    seen = observed(frame, cameras)
    surface = ellipsoid() + position_at(frame.frame) - seen.rig_from_crop[:3, 3]
    uncovered = uncovered_shares(seen.views, seen.valid, surface)
    return consistency(seen.views, seen.valid, np.array([c.K[0, 0] for c in cameras]), uncovered)


def test_cameras_that_agree_are_within_half_a_pixel():
    found = figures(FRAME, CAMERAS)
    assert (found.shift_m < 0.5 * PIXEL).all() and (found.ray_m < 0.05).all()
    assert (found.uncovered < 0.02).all()
    np.testing.assert_allclose(found.shift_m / found.shift_px, found.lines.pixel)
    assert 2 * AXES[1] < found.lines.size < 2 * AXES[0]


def test_a_turn_is_measured_in_pixels_and_metres():
    found = figures(FRAME, turned(CAMERAS, 1, (2.0, 0.0, 0.0)))  # about its right axis: up or down in the image
    moved_px = FOCAL * np.tan(np.deg2rad(2.0))
    # The median over its partners lies across their epipolar planes, which are not upright.
    assert 0.5 * moved_px < found.shift_px[1] < 1.1 * moved_px
    assert 0.8 * moved_px < found.ray_px[1] < 1.3 * moved_px
    assert (np.delete(found.shift_px, 1) < 0.5 * found.shift_px[1]).all()
    assert found.uncovered[1] > 0.1 > found.uncovered[0]


def test_a_camera_that_sees_nothing_has_no_figures():
    blind = FrameSet(0, 0.0, FRAME.rgb, (*FRAME.ids[:3], None))
    found = figures(blind, CAMERAS)
    for values in (found.ray_m, found.shift_px, found.uncovered):
        assert np.isnan(values[3]) and np.isfinite(values[:3]).all()


def test_a_blade_that_one_camera_misses_is_no_shift():
    longer = FRAME.ids[0].copy()
    rows, columns = np.nonzero(longer)
    longer[rows.min() - 14 : rows.min(), columns[rows.argmin()]] = 3  # a rod that the others do not show
    found = figures(FrameSet(0, 0.0, FRAME.rgb, (longer, *FRAME.ids[1:])), CAMERAS)
    assert (found.shift_m < PIXEL).all()


def test_what_a_surface_leaves_bare_is_counted():
    size, K = 64, np.array([[64.0, 0, 32], [0, 64.0, 32], [0, 0, 1]])
    mask = np.zeros((size, size), np.float32)
    mask[16:48, 8:56] = 1
    pose = np.eye(4)
    pose[2, 3] = -1.0  # a pixel is 1/64 m at the origin
    grid = np.stack(np.meshgrid(np.linspace(-0.375, 0.375, 60), np.linspace(-0.25, 0.25, 60), [0.0]), -1).reshape(-1, 3)
    assert uncovered_share(mask, grid, K, pose) == 0
    assert uncovered_share(mask, grid[grid[:, 0] < 0], K, pose) == pytest.approx(20 / 48, abs=0.05)  # 4 px are spread
    assert uncovered_share(mask, grid[:0], K, pose) == 1
