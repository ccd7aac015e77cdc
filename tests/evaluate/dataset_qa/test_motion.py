"""Chamfer distances, spectra and periods of motions that are known."""

from __future__ import annotations

import numpy as np
import pytest

from aerojax.evaluate.dataset_qa.motion import (
    chamfer_matrix,
    class_motions,
    detect_period,
    lag_curve,
    motion_of,
    spectrum,
)


def test_chamfer_distance_by_hand():
    clouds = np.array([[[0.0, 0, 0], [1.0, 0, 0], [1.0, 0, 0]], [[0.0, 0, 0], [0.0, 2.0, 0], [1.0, 0, 0]]])
    # There 0 and 0; back 0, 2 and 0.
    wanted = 0.5 * (0 + 2 / 3)
    assert chamfer_matrix(clouds) == pytest.approx(np.array([[0.0, wanted], [wanted, 0.0]]))


def swinging(period: float, frames: int = 30, reach: float = 0.1) -> np.ndarray:
    """A row of points whose one end swings."""
    x = np.linspace(0.0, 1.0, 40)
    height = reach * np.sin(2 * np.pi * np.arange(frames)[:, None] / period) * x
    return np.stack([np.broadcast_to(x, height.shape), height, np.zeros_like(height)], axis=2)


@pytest.mark.parametrize("period", [5.0, 7.5, 8.0, 12.0, 16.0])
def test_period_of_a_swing(period):
    assert detect_period(lag_curve(chamfer_matrix(swinging(period)))) == pytest.approx(period, abs=0.35)


def test_period_does_not_depend_on_the_start_but_the_first_row_does():
    clouds = np.concatenate([swinging(9.0, 40)])
    early, late = (chamfer_matrix(clouds[start : start + 30]) for start in (0, 2))
    assert np.abs(early[0] - late[0]).max() > 0.01
    assert detect_period(lag_curve(early)) == pytest.approx(detect_period(lag_curve(late)), abs=0.2)


def test_no_period_where_nothing_moves_or_returns():
    assert detect_period(lag_curve(chamfer_matrix(swinging(8.0, reach=0.0)))) is None
    assert detect_period(np.linspace(0.0, 1.0, 30)) is None
    assert detect_period(np.zeros(2)) is None


def test_spectrum_has_sixteen_bins_without_mean():
    magnitude = spectrum(3.0 + np.cos(2 * np.pi * np.arange(30) * 5 / 30))
    assert magnitude.shape == (16,)
    np.testing.assert_allclose(magnitude, 0.5 * (np.arange(16) == 5), atol=1e-12)


def test_motion_of_classes():
    motions = [
        motion_of("bird_a", "bird", swinging(10.0)),
        motion_of("bird_b", "bird", swinging(6.0)),
        motion_of("drone_a", "drone", swinging(8.0, reach=0.0)),
    ]
    bird, drone = class_motions(motions)
    assert (bird.identities, bird.periodic) == (2, 2)
    assert bird.period == pytest.approx(8.0, abs=0.3)
    assert (drone.periodic, drone.period, drone.peak) == (0, None, None)
    np.testing.assert_allclose(bird.mean, (motions[0].to_first + motions[1].to_first) / 2)
    assert class_motions([]) == ()
