"""Flights: what each class may do, and the physical meaning of the angles."""

from __future__ import annotations

import numpy as np
import pytest

from aerojax.core.types import CLASSES
from aerojax.simulate.world import flight as flights
from aerojax.simulate.world.flight import GRAVITY, draw_flight

FORWARD = ("bird", "airplane")


def fly(label, seed, **changes):
    settings = {"frames": 60, "fps": 30.0, "motion": "flight"}
    return draw_flight(label, rng=np.random.default_rng(seed), **(settings | changes))


@pytest.mark.parametrize("label", CLASSES)
@pytest.mark.parametrize("motion", ["flight", "in_place"])
def test_attitudes_are_rotations(label, motion):
    turns = fly(label, 1, motion=motion).world_from_body
    np.testing.assert_allclose(turns @ np.swapaxes(turns, 1, 2), np.broadcast_to(np.eye(3), turns.shape), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(turns), 1.0, atol=1e-12)


@pytest.mark.parametrize("label", CLASSES)
def test_in_place_holds_position_and_heading(label):
    for seed in range(10):
        still = fly(label, seed, motion="in_place", frames=7)
        assert not still.position.any() and still.position.shape == (7, 3)
        np.testing.assert_array_equal(still.world_from_body, still.world_from_body[:1].repeat(7, axis=0))
        assert abs(still.world_from_body[0, 2, 0]) <= np.sin(np.deg2rad(20)) + 1e-12  # elevation of the nose
        assert abs(still.world_from_body[0, 2, 1]) < 1e-12  # wings level


@pytest.mark.parametrize("label", CLASSES)
def test_a_path_keeps_within_its_limit_and_passes_the_origin(label):
    for seed in range(20):
        path = fly(label, seed, max_travel=2.5).position
        assert np.linalg.norm(np.ptp(path, axis=0)) <= 2.5 + 1e-9
        np.testing.assert_allclose(path[len(path) // 2], 0.0, atol=1e-12)


@pytest.mark.parametrize("label", CLASSES)
def test_one_frame_is_a_flight(label):
    alone = fly(label, 0, frames=1)
    assert alone.position.shape == (1, 3) and np.isfinite(alone.world_from_body).all()


@pytest.mark.parametrize("label", FORWARD)
def test_noses_point_along_the_path(label):
    for seed in range(20):
        flown = fly(label, seed)
        velocity = np.diff(flown.position, axis=0)
        direction = velocity / np.linalg.norm(velocity, axis=1, keepdims=True)
        # The path of frame i comes from the step to it; pitch and wobble leave 20 degrees.
        along = np.sum(direction * flown.world_from_body[1:, :, 0], axis=1)
        assert along.min() > np.cos(np.deg2rad(20))


def test_attitude_by_hand():
    angle = np.array([0.3])
    zero = np.zeros(1)
    nose_down = flights._attitude(zero, angle, zero)[0]
    np.testing.assert_allclose(nose_down[:, 0], [np.cos(0.3), 0.0, -np.sin(0.3)])
    left_wing_up = flights._attitude(zero, zero, angle)[0]
    np.testing.assert_allclose(left_wing_up[:, 1], [0.0, np.cos(0.3), np.sin(0.3)])
    to_the_left = flights._attitude(angle, zero, zero)[0]
    np.testing.assert_allclose(to_the_left[:, 0], [np.cos(0.3), np.sin(0.3), 0.0])


@pytest.mark.parametrize("label", FORWARD)
def test_the_inner_wing_goes_down_in_a_turn(label):
    checked = 0
    for seed in range(40):
        flown = fly(label, seed, max_travel=100.0)
        velocity = np.diff(flown.position[:, :2], axis=0)
        heading = np.unwrap(np.arctan2(velocity[:, 1], velocity[:, 0]))
        seconds = np.arange(len(heading)) / 30.0
        rate = np.polyfit(seconds, heading, 1)[0]
        speed = float(np.linalg.norm(np.diff(flown.position, axis=0), axis=1).mean() * 30)
        left_wing_height = float(flown.world_from_body[:, 2, 1].mean())
        bank = np.arctan(speed * rate / GRAVITY)  # tan φ = v ω / g, positive in a left turn
        if abs(bank) > np.deg2rad(12):
            checked += 1
            assert np.sign(left_wing_height) == -np.sign(rate)
            assert abs(np.arcsin(-left_wing_height)) == pytest.approx(abs(bank), abs=np.deg2rad(9))
    assert checked >= 5


def test_a_multicopter_leans_into_its_acceleration():
    cosines = []
    for seed in range(40):
        flown = fly("drone", seed, max_travel=1e9)
        acceleration = np.gradient(np.gradient(flown.position, 1 / 30, axis=0), 1 / 30, axis=0)[3:-3]
        lean = flown.world_from_body[3:-3, :2, 2]  # horizontal part of the up axis: where the thrust pushes
        strong = np.linalg.norm(acceleration[:, :2], axis=1) > 4.0
        if strong.any():
            a, b = acceleration[strong, :2], lean[strong]
            cosines.append(np.sum(a * b, axis=1) / np.linalg.norm(a, axis=1) / np.linalg.norm(b, axis=1))
            tilt = np.arccos(np.clip(flown.world_from_body[3:-3, 2, 2][strong], -1, 1))
            wanted = np.minimum(np.arctan(np.linalg.norm(a, axis=1) / GRAVITY), np.deg2rad(40))
            assert np.abs(tilt - wanted).max() < np.deg2rad(16)  # a steady wind leans it by some degrees
    assert np.median(np.concatenate(cosines)) > 0.95


def lean_of(flown):
    return np.arccos(np.clip(flown.world_from_body[:, 2, 2], -1.0, 1.0))


def test_a_shrunk_flight_keeps_its_shape_and_tilts_less():
    """Flown in the same time on a shorter path, accelerations shrink with it, and the tilt with them."""
    checked = 0
    for seed in range(12):
        wide, narrow = fly("drone", seed, max_travel=1e9), fly("drone", seed, max_travel=0.5)
        scale = np.linalg.norm(np.ptp(narrow.position, axis=0)) / np.linalg.norm(np.ptp(wide.position, axis=0))
        if scale > 0.5:
            continue
        checked += 1
        np.testing.assert_allclose(narrow.position, wide.position * scale, atol=1e-12)
        acceleration = np.gradient(np.gradient(narrow.position, 1 / 30, axis=0), 1 / 30, axis=0)
        wanted = np.arctan(np.linalg.norm(acceleration[:, :2], axis=1) / GRAVITY)
        assert np.abs(lean_of(narrow) - np.minimum(wanted, np.deg2rad(40))).max() < np.deg2rad(16)  # wind
    assert checked >= 3


@pytest.mark.parametrize("label", FORWARD)
def test_a_slower_arc_is_banked_less(label):
    wide, narrow = (np.array([np.abs(fly(label, s, max_travel=m).world_from_body[:, 2, 1]).mean() for s in range(30)])
                    for m in (1e9, 1.0))  # fmt: skip
    assert narrow.mean() < 0.6 * wide.mean()


def test_dashes_turn_sharply_and_tilt_as_far_as_multicopters_do():
    tilts = [np.rad2deg(lean_of(fly("drone", seed, frames=90, max_travel=1e9)).max()) for seed in range(30)]
    assert np.quantile(tilts, 0.9) > 20.0 and max(tilts) < 58.0
    speeds = [np.ptp(np.linalg.norm(np.diff(fly("drone", s, frames=90, max_travel=1e9).position, axis=0), axis=1)) * 30
              for s in range(30)]  # fmt: skip
    assert max(speeds) > 4.0 and min(speeds) < 0.6  # some dash, some hover


def test_long_flights_change_their_turn():
    rates = []
    for seed in range(20):
        velocity = np.diff(fly("airplane", seed, frames=120, max_travel=1e9).position[:, :2], axis=0)
        rates.append(np.diff(np.unwrap(np.arctan2(velocity[:, 1], velocity[:, 0]))) * 30)
    changes = [abs(rate[-10:].mean() - rate[:10].mean()) for rate in rates]
    assert np.median(changes) > 0.1


def test_the_rng_decides():
    np.testing.assert_array_equal(fly("bird", 5).position, fly("bird", 5).position)
    assert np.abs(fly("bird", 5).position - fly("bird", 6).position).max() > 0.1
