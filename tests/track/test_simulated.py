"""What simulated detectors see: noise, misses, false alarms, objects behind others, clocks and rolling shutters."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.flights import ring

from aerojax.geometry.cameras import project_points
from aerojax.track.simulated import FALSE, DetectorConfig, watch

PERFECT = DetectorConfig(noise_px=0.0, missed=0.0, false_alarms=0.0, merge_px=0.0)
CAMERAS = ring(3)
HOW = {"frames": 200, "fps": 30.0, "stagger": False}


def flying(height: float):
    """Straight on at 6 m/s and down at 3 m/s."""
    return lambda times: np.array([-15.0, 0.0, height]) + np.asarray(times)[:, None] * np.array([6.0, 0.0, -3.0])


def seen(config: DetectorConfig, paths, cameras=CAMERAS, **how):
    return watch(paths, cameras, config=config, rng=np.random.default_rng(0), **{**HOW, **how})


def test_perfect_detectors_see_projections_at_their_clocks_moments():
    late = replace(CAMERAS[1], time_offset_s=0.1, clock_rate=1.001, line_delay_s=1e-5)
    found = seen(PERFECT, [flying(30.0)], (CAMERAS[0], late), frames=50)
    for index, camera in enumerate((CAMERAS[0], late)):
        own = found.detections.chosen(found.detections.camera == index)
        moments = camera.network_time(own.stamp_s, own.pixels[:, 1])
        np.testing.assert_allclose(own.pixels, project_points(flying(30.0)(moments), camera), atol=1e-4)
        assert len(own.camera) == 50


def test_shares_of_misses_and_false_alarms_and_the_noise():
    config = DetectorConfig(noise_px=2.0, missed=0.3, false_alarms=1.5, merge_px=0.0)
    found, exact = seen(config, [flying(30.0)]), seen(PERFECT, [flying(30.0)])
    images = len(exact.source)
    assert np.count_nonzero(found.source == 0) == pytest.approx(0.7 * images, rel=0.1)
    assert np.count_nonzero(found.source == FALSE) == pytest.approx(1.5 * 600, rel=0.1)
    own = found.detections.chosen(found.source == 0)
    moments = CAMERAS[0].network_time(own.stamp_s, own.pixels[:, 1])
    off = [
        o - project_points(flying(30.0)(m[None]), CAMERAS[c])[0]
        for o, m, c in zip(own.pixels, moments, own.camera, strict=True)
    ]
    assert np.std(off) == pytest.approx(2.0, rel=0.1)


def test_what_is_behind_another_object_is_not_seen():
    eye = CAMERAS[0].world_from_cam[:3, 3]

    def behind(times):
        return eye + 1.1 * (flying(30.0)(times) - eye)

    config = replace(PERFECT, merge_px=5.0)
    found = seen(config, [behind, flying(30.0)])
    of_first = [np.count_nonzero((found.detections.camera == c) & (found.source == 0)) for c in range(3)]
    assert of_first[0] == 0 and min(of_first[1:]) > 0
    assert np.count_nonzero(found.source == 1) == np.count_nonzero(seen(PERFECT, [flying(30.0)]).source == 0)
