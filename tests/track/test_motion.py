"""The filter against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from support.flights import ring

from aerojax.track.motion import STATE, MotionConfig, born, expect, predict, update
from aerojax.track.sights import NoiseConfig, Scan, sight_of_points

NOISE = NoiseConfig(rotation_deg=0.0, position_m=0.0)


def some_tracks(count: int = 2):
    rng = np.random.default_rng(0)
    states = rng.normal(size=(count, STATE)) * np.repeat([5.0, 4.0, 1.0, 0.2], 3) + np.eye(STATE)[2] * 20
    root = rng.normal(size=(count, STATE, STATE)) * 0.3
    return states, root @ np.swapaxes(root, 1, 2) + 0.01 * np.eye(STATE)


def test_prediction_by_hand():
    state = np.array([[1.0, 0, 0, 2.0, 0, 0, 3.0, 0, 0, 0.5, 0, 0]])
    before = np.zeros((1, STATE, STATE))
    moved, spread = predict(state, before, 2.0, MotionConfig(jerk=1.0), np.array([0.3]))
    assert moved[0, [0, 3, 6, 9]] == pytest.approx([1 + 4 + 6, 2 + 6, 3, 0])
    assert spread[0, [0, 3, 6, 9], [0, 3, 6, 9]] == pytest.approx([2**5 / 20, 2**3 / 3, 2, 0.09])
    assert spread[0, 0, 1] == 0


def test_two_short_predictions_are_one_long_one():
    states, spreads = some_tracks()
    config, shaken = MotionConfig(), np.array([0.0, 0.2])
    once = predict(states, spreads, 0.3, config, shaken)
    twice = predict(*predict(states, spreads, 0.1, config, shaken), 0.2, config, shaken)
    for one, two in zip(once, twice, strict=True):
        np.testing.assert_allclose(one, two, rtol=1e-10, atol=1e-10)


def test_update_is_the_information_filter():
    """P⁻¹ + HᵀR⁻¹H and its mean, by another formula."""
    camera = ring()[0]
    states, spreads = some_tracks()
    pixels = sight_of_points(states[:, :3], camera)[0] + 2.0
    scan = Scan(0, 0.0, np.zeros(2), pixels, np.full(2, 4.0), np.zeros(2), np.arange(2))
    expected = expect(states, spreads, scan, camera, NOISE)
    moved, after = update(states, spreads, expected, np.arange(2), np.arange(2))
    for i in range(2):
        H, off = expected.by_state[i, i], expected.off[i, i]
        information = np.linalg.inv(spreads[i]) + H.T @ H / 4.0
        np.testing.assert_allclose(after[i], np.linalg.inv(information), rtol=1e-7, atol=1e-9)
        np.testing.assert_allclose(moved[i], states[i] + np.linalg.solve(information, H.T @ off / 4.0), rtol=1e-8)


def test_each_row_of_a_rolling_shutter_is_expected_at_its_moment():
    camera = ring()[0]
    states, spreads = some_tracks(1)
    lag = 0.02
    position, velocity, acceleration, aside = np.split(states[0], 4)
    late = sight_of_points(position + lag * velocity + lag**2 / 2 * acceleration + aside, camera)[0]
    scan = Scan(0, 1.0, np.array([1.0 + lag]), late[None], np.ones(1), np.zeros(1), np.zeros(1, np.int64))
    expected = expect(states, spreads, scan, camera, NOISE)
    np.testing.assert_allclose(expected.off[0, 0], 0, atol=1e-9)
    step = 1e-4 * np.eye(STATE)
    for axis in range(STATE):
        there = expect(states + step[axis], spreads, scan, camera, NOISE).off[0, 0]
        np.testing.assert_allclose(expected.by_state[0, 0, :, axis], -there / 1e-4, rtol=1e-3, atol=1e-3)


def test_what_is_behind_a_camera_is_not_expected():
    camera = ring()[0]
    states, spreads = some_tracks(1)
    states[0, :3] = camera.world_from_cam[:3, 3] - 10 * camera.world_from_cam[:3, 2]
    scan = Scan(0, 0.0, np.zeros(1), np.array([[960.0, 540]]), np.ones(1), np.zeros(1), np.zeros(1, np.int64))
    assert np.isinf(expect(states, spreads, scan, camera, NOISE).distance).all()


def test_a_birth_knows_no_acceleration_and_only_the_outline():
    mean, spread = born(np.arange(6.0), np.eye(6), MotionConfig(acceleration=2.0), 0.5)
    assert mean.tolist() == [0, 1, 2, 3, 4, 5, 0, 0, 0, 0, 0, 0]
    assert np.diag(spread).tolist() == [1.25] * 3 + [1] * 3 + [4] * 3 + [0.25] * 3
    middle = np.concatenate([np.eye(3), np.zeros((3, 6)), np.eye(3)], axis=1)
    np.testing.assert_allclose(middle @ spread @ middle.T, np.eye(3))


def test_what_shakes_all_cameras_alike_is_learnt_from_the_first():
    """The middle is known after one camera, the body no better than the outline allows."""
    cameras = ring()
    state = np.concatenate([[0.0, 0, 22], np.zeros(9)])[None]
    states, spreads = predict(state, 1e-4 * np.eye(STATE)[None], 0.1, MotionConfig(jerk=0.0), np.array([0.5]))
    seen = states[0, :3] + [0.0, 0.0, 0.8]
    for index, camera in enumerate(cameras[:2]):
        pixels = sight_of_points(seen, camera)[0][None]
        scan = Scan(index, 0.1, np.full(1, 0.1), pixels, np.ones(1), np.full(1, 90.0), np.zeros(1, np.int64))
        expected = expect(states, spreads, scan, camera, NOISE)
        assert expected.distance[0, 0] < (4.0 if index == 0 else 0.5)
        states, spreads = update(states, spreads, expected, np.zeros(1, np.int64), np.zeros(1, np.int64))
    assert abs(states[0, 2] - 22) < 0.01 and states[0, 11] == pytest.approx(0.8, abs=0.05)
