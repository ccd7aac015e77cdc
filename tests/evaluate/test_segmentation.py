"""Silhouettes against masks: overlaps, what was missed, ghosts."""

from __future__ import annotations

import numpy as np
import pytest

from aerojax.core.types import FrameSet, Silhouette
from aerojax.evaluate.clutter import Clutter, ClutterConfig, cluttered
from aerojax.evaluate.segmentation import frame_score, segmentation_figures, segmentation_table


def square(x, y, side=30):
    mask = np.zeros((80, 120), np.float32)
    mask[y : y + side, x : x + side] = 1
    return mask


def silhouette(camera, number, mask):
    return Silhouette(camera, number, mask, (0.0, 0.0, 1.0, 1.0), True)


def frames_of(*masks, frame=0):
    ids = tuple(mask.astype(np.uint16) for mask in masks)
    return FrameSet(frame, frame / 30, (np.full((80, 120, 3), 0.5, np.float32),) * len(ids), ids)


def test_objects_are_paired_over_all_cameras_and_the_rest_are_ghosts():
    first, second = 4 * square(10, 10), 9 * square(70, 40)
    frames = frames_of(first + second, first)
    found = [
        silhouette(0, 2, square(10, 10)),
        silhouette(0, 1, square(70, 55)),
        silhouette(1, 2, square(10, 10)),
        silhouette(1, 5, square(80, 10, side=10)),
    ]
    score = frame_score(frames, found)
    assert score.numbers == {4: 2, 9: 1} and score.ghosts == 1
    np.testing.assert_allclose(score.overlaps, [1.0, 15 * 30 / (30 * 30 + 10 * 30), 1.0], atol=1e-6)


def test_small_images_do_not_count_and_what_is_not_found_does():
    frames = frames_of(square(10, 10, side=12) + 2 * square(50, 10, side=25))
    assert frame_score(frames, []).overlaps == (0.0,)
    assert frame_score(frames, [], least_span=10.0).overlaps == (0.0, 0.0)


def test_figures_and_table():
    frames = frames_of(square(10, 10))
    scores = [frame_score(frames, [silhouette(0, number, square(10, 10))]) for number in (1, 1, 3)]
    scores.append(frame_score(frames, [silhouette(0, 3, square(80, 40))]))
    figures = segmentation_figures(scores)
    assert figures == {
        "frames": 4,
        "images": 4,
        "median_iou": 1.0,
        "iou_10": pytest.approx(0.3),
        "missed": 0.25,
        "ghosts_in_100": 25.0,
        "number_changes": 1,
    }
    row = {"capture": "a", "cameras": 3, "views": 0, "step_ms": 12.3, **figures}
    assert segmentation_table([row]).splitlines()[-1] == "| a | 3 | rule | 1.00 | 0.30 | 0.25 | 25.0 | 12 |"
    assert segmentation_figures([])["median_iou"] is None


def test_clutter_is_a_function_of_the_frame_and_lies_behind_the_objects():
    config = ClutterConfig(noise=0.0, sway_px=0.0, drift=0.0)
    clutter = [Clutter(120, 80, seed=3, config=config)]
    mask = square(40, 40)
    one, again, later = (cluttered(frames_of(mask, frame=f), clutter) for f in (5, 5, 40))
    np.testing.assert_array_equal(one.rgb[0], again.rgb[0])
    assert np.abs(one.rgb[0] - later.rgb[0]).max() > 0.05
    np.testing.assert_allclose(one.rgb[0][mask > 0], 0.5, atol=1e-6)
    np.testing.assert_array_equal(one.ids[0], mask.astype(np.uint16))
    blank = FrameSet(0, 0.0, (None,), (None,))
    assert cluttered(blank, clutter).rgb == (None,)


def test_sway_moves_image_and_mask_alike():
    config = ClutterConfig(clouds=0.0, leaves=0, shadows=0, noise=0.0, drift=0.0, sway_px=4.0)
    mask = square(40, 30)
    frames = frames_of(mask)
    image = np.repeat(mask[..., None], 3, axis=-1)
    seen = cluttered(FrameSet(7, 0.0, (image,), frames.ids), [Clutter(120, 80, seed=1, config=config)])
    np.testing.assert_array_equal(seen.rgb[0][..., 0] > 0.5, seen.ids[0] > 0)
    assert (seen.ids[0] != frames.ids[0]).any()
