"""Over a clip: the camera that is wrong, whether its clock or its pose, and how much."""

from __future__ import annotations

import numpy as np
import pytest
from support.disagreeing_cameras import late, observed, turned
from support.networks import frame_sets, network

from aerojax.reconstruct.consistency import consistency
from aerojax.reconstruct.disagreement import Disagreement, slope, suspect

CAMERAS = network()
FRAMES = list(frame_sets(CAMERAS, range(18)))


def sums(frames, cameras) -> list[Disagreement]:
    """Of each frame, with the velocity of the last five."""
    focal, path, found = np.array([c.K[0, 0] for c in cameras]), [], []
    for frame in frames:
        seen = observed(frame, cameras)
        path = [*path, (frame.time_s, seen.rig_from_crop[:3, 3])][-5:]
        velocity = slope([t for t, _ in path], [x for _, x in path])
        found.append(Disagreement.of(consistency(seen.views, seen.valid, focal, np.ones(len(cameras))), velocity))
    return found


def added(found: list[Disagreement]) -> Disagreement:
    return sum(found[1:], found[0])


def test_cameras_that_agree_stay_below_one():
    assert added(sums(FRAMES, CAMERAS)).level < 0.3


@pytest.mark.parametrize("camera", [1, 3])
def test_a_turned_camera_is_named_with_its_angle(camera):
    total = added(sums(FRAMES, turned(CAMERAS, camera, (1.2, -1.6, 0.0))))
    found = suspect(total)
    assert total.level > 1.5
    assert found is not None and found.camera == camera and found.cause == "turn"
    assert found.turn_deg == pytest.approx(2.0, rel=0.25)
    assert found.offset_m == pytest.approx(5 * np.deg2rad(2.0), rel=0.35)  # cameras are about 5 m away


@pytest.mark.parametrize("count", [2, 4])
def test_a_late_clock_is_named_with_its_lateness(count):
    found = suspect(added(sums(late(FRAMES, 2, count), CAMERAS)))
    assert found is not None and found.camera == 2 and found.cause in ("clock", "either")
    assert found.late_s == pytest.approx(count / 30, rel=0.25)


def test_an_early_clock_has_the_other_sign():
    backwards = late(FRAMES[::-1], 2, 3)[::-1]  # the camera shows what was three frames before
    found = suspect(added(sums(backwards, CAMERAS)))
    assert found is not None and found.camera == 2 and found.late_s == pytest.approx(-0.1, rel=0.25)


def test_nothing_is_named_where_all_are_wrong_or_few_are_seen():
    wrong = CAMERAS
    for camera, turn in enumerate([(2, 0, 0), (-2, 1, 0), (1, 2, 0), (-1, -2, 0)]):
        wrong = turned(wrong, camera, turn)
    total = added(sums(FRAMES[:6], wrong))
    assert total.level > 1.5 and suspect(total) is None
    assert suspect(Disagreement.none(4)) is None and Disagreement.none(4).level == 0


def test_sums_do_not_depend_on_where_the_frames_are_split():
    found = sums(FRAMES[:6], turned(CAMERAS, 1, (1.0, 0.0, 0.0)))
    whole, parts = added(found), added(found[:2]) + added(found[2:])
    assert whole.level == pytest.approx(parts.level) and whole.frames == parts.frames == 6
    np.testing.assert_allclose(whole.normal, parts.normal)


def test_slope():
    assert slope([0.0], [np.zeros(3)]) is None and slope([], []) is None
    times = [10.0, 10.1, 10.3]
    found = slope(times, [np.array([1.0, 2.0, -3.0]) * t + 5 for t in times])
    assert found is not None
    np.testing.assert_allclose(found, [1, 2, -3])
