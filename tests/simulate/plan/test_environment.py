"""Days of sequences: a sun that moves and climbs as its rig says, and nothing else that changes with it."""

from __future__ import annotations

import dataclasses

import numpy as np
from support.dataset_configs import config_of

from aerojax.simulate.plan.environment import draw_sky
from aerojax.simulate.world.sky import sun_direction

RIG = config_of("rig=sim2", "preset=smoke").rig


def elevation_of(direction):
    return np.rad2deg(np.arcsin(direction[2]))


def test_the_sun_rises_or_sinks_from_sequence_to_sequence():
    climbing = dataclasses.replace(RIG, sun_climb=4.0)
    skies = [draw_sky(climbing, np.random.default_rng(seed)) for seed in range(60)]
    rates = np.array([sky.sun_elevation_rate for sky in skies])
    assert rates.min() < -3.0 and rates.max() > 3.0 and np.abs(rates).max() <= 4.0
    for sky in skies[:5]:
        before, after = (elevation_of(sun_direction(sky, time)) for time in (0.0, 1.5))
        np.testing.assert_allclose(after - before, 1.5 * sky.sun_elevation_rate, atol=1e-9)


def test_a_climbing_sun_leaves_the_rest_of_the_day_as_it_was():
    still, climbing = (
        draw_sky(dataclasses.replace(RIG, sun_climb=climb), np.random.default_rng(7)) for climb in (0.0, 4.0)
    )
    assert still.sun_elevation_rate == 0.0 != climbing.sun_elevation_rate
    assert dataclasses.replace(climbing, sun_elevation_rate=0.0) == still
