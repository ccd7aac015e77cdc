"""Flights of outliers: rotations, limits, gravity; classes fly as they did."""

from __future__ import annotations

import numpy as np
import pytest

from aerojax.core.types import CLASSES
from aerojax.simulate.assets.outliers.kinds import KINDS
from aerojax.simulate.world.flight import GRAVITY, draw_flight
from aerojax.simulate.world.passive_flight import draw_motion


def moved(what, seed, draw=draw_motion, **changes):
    settings = {"frames": 30, "fps": 30.0, "motion": "flight"}
    return draw(what, rng=np.random.default_rng(seed), **(settings | changes))


@pytest.mark.parametrize("label", CLASSES)
def test_classes_fly_as_without_outliers(label):
    one, other = moved(label, 4), moved(label, 4, draw_flight)
    np.testing.assert_array_equal(one.transforms(), other.transforms())


@pytest.mark.parametrize("kind", KINDS)
def test_attitudes_are_rotations_and_paths_keep_within_their_limit(kind):
    for seed in range(8):
        flown = moved(kind, seed, max_travel=2.0)
        turns = flown.world_from_body
        np.testing.assert_allclose(turns @ turns.transpose(0, 2, 1), np.eye(3)[None].repeat(30, 0), atol=1e-9)
        np.testing.assert_allclose(np.linalg.det(turns), 1.0, atol=1e-9)
        assert np.linalg.norm(np.ptp(flown.position, axis=0)) <= 2.0 + 1e-9
        np.testing.assert_allclose(flown.position[15], 0.0, atol=1e-12)
    assert moved(kind, 0, frames=1).position.shape == (1, 3)


@pytest.mark.parametrize("kind", ["ball", "balloon", "kite", "leaf", "disc"])
def test_in_place_holds_position_and_goes_on_turning(kind):
    still = moved(kind, 3, motion="in_place")
    assert not still.position.any()
    np.testing.assert_array_equal(still.world_from_body, moved(kind, 3).world_from_body)
    assert not np.allclose(still.world_from_body[0], still.world_from_body[-1])


def test_what_is_thrown_falls():
    falling = 0
    for seed in range(10):
        height = moved("ball", seed, max_travel=1e9).position[:, 2]
        second = np.diff(height, 2) * 30.0**2
        free = np.isclose(second, -GRAVITY, atol=1e-6)
        falling += free.mean() >= 0.9  # the others bounce, and do not fall in the frames of a contact
        assert free.mean() >= 0.7
    assert falling >= 3
