"""Paths' jerks are those with which the paths were made."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.flights import ring

from aerojax.track.adjust.adjustment import solve
from aerojax.track.adjust.problem import AdjustConfig, Guess, Problem, Sights
from aerojax.track.adjust.splines import Knots
from aerojax.track.adjust.stiffness import likely_jerks
from aerojax.track.sights import sight_of_points


@pytest.mark.parametrize("jerk", [3.0, 60.0])
def test_the_likeliest_jerk_is_the_true_one(jerk):
    rng = np.random.default_rng(0)
    cameras, knots = ring(3), Knots(-0.1, 0.2, 60)
    each = rng.normal(0, jerk / np.sqrt(knots.spacing_s), (60, 3))
    # Control points whose third differences those are, from a start at rest.
    controls = np.array([0.0, 0.0, 12.0]) + np.vstack(
        [np.zeros((3, 3)), np.cumsum(np.cumsum(np.cumsum(each, 0), 0), 0) * knots.spacing_s**3]
    )
    drift = np.linspace(0, 1, len(controls))[:, None]
    controls -= drift * (controls[-1] - [0.0, 0.0, 12.0])  # straight flight has no jerk
    times = np.tile(np.arange(0, 11.8, 1 / 30), 3)
    camera = np.repeat(np.arange(3), len(times) // 3)
    first, weights, _ = knots.weights(times)
    points = np.einsum("sk,ska->sa", weights, controls[first[:, None] + np.arange(4)])
    pixels = np.stack([sight_of_points(p, cameras[c])[0] for p, c in zip(points, camera, strict=True)])
    pixels += rng.normal(size=pixels.shape)
    ones, none = np.ones(len(times)), np.zeros(len(times), np.int64)
    sights = Sights(camera, times, pixels[:, 1], pixels, ones, none)
    problem = Problem(sights, cameras, (knots,), (30.0,), np.zeros((3, 9), bool), AdjustConfig())
    guess = Guess(cameras, (controls,))
    for _ in range(4):
        guess, _ = solve(problem, guess, lambda done, total, what: None)
        problem = replace(problem, jerks=likely_jerks(problem, guess))
    assert problem.jerks[0] == pytest.approx(jerk, rel=0.3)
