"""Figures of reconstructions: the truth is best, nothing is worst, and distances are known."""

from __future__ import annotations

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.view_sets import DISTANCE, ball, ball_scenes

from aerojax.evaluate.reconstruction import (
    HIGHER_IS_BETTER,
    binned,
    chamfer,
    mean_figures,
    scene_figures,
    targets_at,
    true_surface,
    views_at,
)

SCENES = ball_scenes(2, targets=6)


def figures(gaussians, count=60):
    return scene_figures(gaussians, count, targets_at(SCENES, 0), true_surface(SCENES, 0), None)[0]


def test_the_truth_is_best_and_nothing_is_worst():
    truth = ball(jax.random.key(0))
    right, fat, none = figures(truth), figures(replace(truth, mean=1.4 * truth.mean)), figures(truth, 0)
    assert right["psnr_db"] > 35 and right["iou"] > 0.97 and right["gaussians"] == 60
    for name in HIGHER_IS_BETTER:
        assert right[name] > fat[name] and right[name] > none[name]
    assert right["chamfer_percent"] < fat["chamfer_percent"] < none["chamfer_percent"]
    assert none["iou"] == 0.0 and none["gaussians"] == 0.0


def test_padding_does_not_count():
    truth = ball(jax.random.key(0))
    padded = jax.tree.map(lambda leaf: jnp.concatenate([leaf, leaf[:1] * 0 + 3.0]), truth)
    assert figures(padded) == pytest.approx(figures(truth), rel=1e-5)


def test_the_surface_is_where_the_targets_see_it():
    points = true_surface(SCENES, 1)
    np.testing.assert_allclose(np.linalg.norm(points, axis=1).mean(), 0.35, atol=0.06)
    views, valid = views_at(SCENES, 1)
    assert views.rgb.shape == (8, 32, 32, 3) and valid.sum() == 4
    np.testing.assert_allclose(np.linalg.norm(views.camera.world_from_cam[:, :3, 3], axis=1), DISTANCE, rtol=1e-5)


def test_chamfer_distances():
    grid = np.stack(np.meshgrid(*[np.arange(4.0)] * 3), axis=-1).reshape(-1, 3)
    assert chamfer(grid, grid) == 0.0
    assert chamfer(grid, grid + np.array([0.25, 0.0, 0.0])) == pytest.approx(0.25)
    assert chamfer(np.zeros((0, 3)), grid) == 3.0 and chamfer(np.zeros((0, 3)), np.zeros((0, 3))) == 0.0


def test_means_and_bins():
    rows = [{"psnr_db": p, "width_px": w} for p, w in ((10.0, 4.0), (20.0, 8.0), (30.0, 9.0))]
    mean = mean_figures(rows)
    assert mean["psnr_db"] == 20.0 and mean["psnr_standard_error"] == pytest.approx(10 / np.sqrt(3))
    assert binned(rows, "width_px", (0.0, 8.0, 16.0, 32.0)) == [
        {"from": 0.0, "to": 8.0, "scenes": 1.0, "psnr_db": 10.0},
        {"from": 8.0, "to": 16.0, "scenes": 2.0, "psnr_db": 25.0},
    ]
