"""Clocks and poses from one recording: what was wrong is found, and what was right is left alone."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from support.flights import frames_of, path, ring, watch

from aerojax.core.errors import UserError
from aerojax.evaluate.tracking import tracking_figures
from aerojax.track.adjust.corrections import Correction, corrected, corrections_to_json, difference
from aerojax.track.adjust.problem import AdjustConfig, Guess, Problem, Sights, linearise, lookable
from aerojax.track.adjust.recording import adjust_recording
from aerojax.track.adjust.splines import fit, knots_over
from aerojax.track.following import FollowingConfig
from aerojax.track.offline import follow
from aerojax.track.sights import TimedCamera

FOLLOWING = FollowingConfig()
ONLY_POSES = AdjustConfig(clocks=False, line_delay=False)


def moved(camera: TimedCamera, *, turn=(0.0, 0.0, 0.0), shift=(0.0, 0.0, 0.0)) -> TimedCamera:
    return corrected(camera, Correction(0.0, 0.0, 0.0, np.array(turn), np.array(shift), np.zeros(9)))


def errors(found: TimedCamera, true: TimedCamera) -> tuple[float, float]:
    """Degrees and metres."""
    off = difference(found, true, np.zeros(9))
    return off.angle_deg, off.distance_m


def test_corrections_lead_from_one_camera_to_another():
    camera = ring()[0]
    values = np.array([0.1, 1e-3, 1e-5, 0.01, -0.02, 0.03, 0.5, 0.6, -0.7])
    one = Correction.of(values, np.zeros(9))
    np.testing.assert_allclose(difference(camera, corrected(camera, one), np.zeros(9)).values(), values, atol=1e-12)
    (told,) = corrections_to_json([camera], [one])
    assert json.loads(json.dumps(told))["rotation_deg"] == pytest.approx(np.degrees([0.01, -0.02, 0.03]))


def test_derivatives_are_those_of_differences():
    rng = np.random.default_rng(0)
    cameras = tuple(replace(c, line_delay_s=1e-5) for c in ring(3))
    seen = watch([path(rng)], cameras, seconds=0.6, rng=rng, clutter=0.0, missed=0.5).detections
    times = np.linspace(0, 0.6, 20)
    knots = knots_over(times, 0.3, 0.05)
    controls = fit(knots, times, path(np.random.default_rng(0)).at(times), smooth=1e-6)
    sights = Sights(
        seen.camera,
        seen.stamp_s,
        seen.pixels[:, 1],
        seen.pixels,
        np.full(len(seen.camera), 2.0),
        np.zeros(len(seen.camera), np.int64),
    )
    looked = lookable(AdjustConfig(), 3)
    problem = Problem(sights, cameras, (knots,), (30.0,), looked, AdjustConfig())
    guess = Guess(cameras, (controls,))
    now = linearise(problem, guess)
    scale = np.concatenate(
        [np.full(3 * knots.controls, 1e-4), np.tile([1e-5, 1e-5, 1e-9] + [1e-7] * 3 + [1e-5] * 3, 3)]
    )
    for column, size in enumerate(scale):
        step = np.zeros(problem.unknowns)
        step[column] = size
        ahead, back = (linearise(problem, guess.moved(problem, s)).off for s in (step, -step))
        derivative = now.by_unknown[:, [column]].toarray()[:, 0]
        np.testing.assert_allclose(
            derivative, (ahead - back) / (2 * size), rtol=2e-3, atol=2e-4 * np.abs(derivative).max()
        )
    assert now.cost > 0 and problem.free.tolist().count(3 * knots.controls) == 0  # the first camera's clock is given


def test_a_camera_that_was_turned_is_found():
    rng = np.random.default_rng(0)
    true = ring(4)
    given = (*true[:2], moved(true[2], turn=np.radians([0.3, -0.3, 0.25])), true[3])
    seen = watch([path(rng)], true, seconds=5.0, rng=rng, noise_px=0.5, clutter=0.2)
    made = adjust_recording(seen.detections, given, FOLLOWING, ONLY_POSES)
    assert max(errors(f, t)[0] for f, t in zip(made.apply(given), true, strict=True)) < 0.05
    assert made.before_px[2] > 5 and max(made.after_px) < 1.0
    assert made.corrections[0].offset_s == 0 and made.corrections[2].angle_deg == pytest.approx(0.49, abs=0.05)


@pytest.mark.parametrize(("diagonal", "alone"), [(60.0, True), (0.0, False)], ids=["boxes", "points"])
def test_what_middles_of_boxes_may_be_beside_an_object_is_no_wrong_clock(diagonal, alone):
    """One clock is late by a tenth of a second: part of a box's size, but much for a point."""
    rng = np.random.default_rng(0)
    cameras = ring(3)
    seen = watch([path(rng)], cameras, seconds=3.0, rng=rng, noise_px=0.3, clutter=0.0).detections
    late = replace(seen, stamp_s=seen.stamp_s + 0.1 * (seen.camera == 1), diagonal=np.full(len(seen.camera), diagonal))
    found = adjust_recording(late, cameras, FOLLOWING, AdjustConfig(poses=False, line_delay=False, search_s=0.0))
    assert (found.middles[1].late_s == 0) == alone
    assert alone or found.middles[1].late_s == pytest.approx(-0.1, abs=0.02)
    assert found.middles[1].sigma_s > 0 and found.middles[0].sigma_s == 0


@pytest.mark.long
@pytest.mark.parametrize("seed", range(3))
def test_clocks_that_are_wrong(seed):
    """Offsets to 200 ms, rates to 0.1 %, shutters of 20 ms: offsets to 5 ms, errors at most doubled."""
    rng = np.random.default_rng(seed + 100)
    given = ring(4 + seed % 2, seed=seed)
    wrong = [(0.0, 1.0), *((rng.uniform(-0.2, 0.2), 1 + rng.choice([-1, 1]) * 1e-3) for _ in given[1:])]
    true = tuple(
        replace(c, time_offset_s=o, clock_rate=r, line_delay_s=0.02 / c.height)
        for c, (o, r) in zip(given, wrong, strict=True)
    )
    paths = [path(rng) for _ in range(1 + seed)]
    seen = watch(paths, true, seconds=20.0, rng=rng, stagger=True)
    found = adjust_recording(seen.detections, given, FOLLOWING, AdjustConfig()).apply(given)
    for one, camera in zip(found, true, strict=True):
        # In the middle of the recording; at its beginning the rate's error counts ten seconds more.
        ours_s, true_s = (c.network_time(np.array([10.0]), np.array([540.0])) for c in (one, camera))
        assert ours_s == pytest.approx(true_s, abs=0.005)
    ours, perfect = (
        tracking_figures(frames_of(follow(seen.detections, cameras, FOLLOWING), paths)) for cameras in (found, true)
    )
    assert ours.rmse <= 2 * perfect.rmse and ours.idf1 >= 0.95
    lost = tracking_figures(frames_of(follow(seen.detections, given, FOLLOWING), paths))
    assert lost.idf1 < 0.9  # as they were given


@pytest.mark.long
@pytest.mark.parametrize("seed", range(4))
def test_a_camera_that_is_wrong_by_half_a_degree_or_a_hand(seed):
    rng = np.random.default_rng(seed + 100)
    true = ring(4 + seed % 2, seed=seed)
    which = int(rng.integers(len(true)))
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    wrong = moved(true[which], turn=np.radians(0.5) * axis) if seed % 2 else moved(true[which], shift=0.2 * axis)
    given = (*true[:which], wrong, *true[which + 1 :])
    seen = watch([path(rng)], true, seconds=20.0, rng=rng, noise_px=0.5)
    found = adjust_recording(seen.detections, given, FOLLOWING, ONLY_POSES).apply(given)
    off = [errors(f, t) for f, t in zip(found, true, strict=True)]
    assert max(angle for angle, _ in off) < 0.05 and max(distance for _, distance in off) < 0.03


def test_what_nobody_follows_cannot_be_adjusted():
    given = ring(3)
    seen = watch([path(np.random.default_rng(0))], given, seconds=0.3, rng=np.random.default_rng(0))
    with pytest.raises(UserError, match="no object was followed") as caught:
        adjust_recording(seen.detections, given, FOLLOWING, ONLY_POSES)
    assert caught.value.code == "no-usable-frames"
