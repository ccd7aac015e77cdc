"""Splines against polynomials and differences."""

from __future__ import annotations

import numpy as np
import pytest

from aerojax.track.adjust.splines import Knots, fit, knots_over


def test_cubic_paths_are_exact():
    times = np.linspace(0.0, 3.0, 80)
    powers = np.stack([np.ones(80), times, times**2, times**3], axis=1)
    places = powers @ np.random.default_rng(0).normal(size=(4, 3))
    knots = knots_over(times, 0.25, 0.1)
    controls = fit(knots, times, places, smooth=0.0)
    first, weights, slopes = knots.weights(times)
    near = controls[first[:, None] + np.arange(4)]
    np.testing.assert_allclose(np.einsum("sk,ska->sa", weights, near), places, atol=1e-6)
    np.testing.assert_allclose(weights.sum(axis=1), 1.0)
    velocity = np.gradient(places, times, axis=0)[5:-5]
    np.testing.assert_allclose(np.einsum("sk,ska->sa", slopes, near)[5:-5], velocity, atol=0.05)
    jerk = knots.jerk_matrix() @ controls
    np.testing.assert_allclose(jerk[2:-2], np.broadcast_to(jerk[5], jerk[2:-2].shape), rtol=1e-3, atol=1e-3)


def test_slopes_are_derivatives():
    knots = Knots(0.0, 0.3, 5)
    times = np.array([-0.1, 0.01, 0.29, 0.31, 1.0, 1.6])
    step = 1e-6
    ahead, back = (knots.weights(times + s)[1] for s in (step, -step))
    np.testing.assert_allclose(knots.weights(times)[2], (ahead - back) / (2 * step), atol=1e-7)


def test_a_gap_is_bridged_smoothly():
    times = np.concatenate([np.linspace(0, 1, 30), np.linspace(2, 3, 30)])
    places = np.stack([times, 2 * times, np.zeros(60)], axis=1)
    knots = knots_over(times, 0.2, 0.0)
    controls = fit(knots, times, places, smooth=1e-6)
    first, weights, _ = knots.weights(np.array([1.5]))
    assert weights[0] @ controls[first[0] : first[0] + 4] == pytest.approx([1.5, 3.0, 0.0], abs=1e-3)
