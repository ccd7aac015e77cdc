"""Pictures become frames by their times; buffers are bounded, late cameras waited for, silent ones named."""

from __future__ import annotations

import threading

import pytest
from support.live_sites import Clock, picture

from aerojax.core.errors import UserError
from aerojax.serve.intake import Intake, IntakeConfig
from aerojax.serve.notices import CameraBack, CameraSilent, CamerasLacking, FramesDropped, SourceFailed


@pytest.fixture
def clock() -> Clock:
    return Clock()


def made(clock: Clock, cameras: int = 3, **settings) -> Intake:
    return Intake(cameras, 10.0, IntakeConfig(**settings), clock=clock)


def times(taken) -> list[float | None]:
    return [None if one is None else one.time_s for one in taken.pictures]


def test_a_frame_is_made_when_every_camera_has_given_a_picture(clock):
    intake = made(clock)
    for camera, moment in ((0, 1.0), (1, 1.04)):
        intake.put(picture(camera, moment))
    assert intake.take(0.0) is None
    clock.now += 0.1
    intake.put(picture(2, 0.98))
    taken = intake.take(0.0)
    assert taken is not None and times(taken) == [1.0, None, 0.98]  # 60 ms apart, half a frame is 50 ms
    assert taken.arrived_s == clock.now and taken.time_s == 0.98
    for camera in (0, 2):
        intake.put(picture(camera, 1.1))
    assert times(intake.take(0.0)) == [None, 1.04, None]
    assert intake.take(0.0) is None  # camera 1 may yet give the frame of 1.1


def test_a_late_camera_is_waited_for_and_no_longer(clock):
    intake = made(clock, wait_s=0.2)
    intake.put(picture(0, 1.0))
    intake.put(picture(1, 1.0))
    clock.now += 0.19
    assert intake.take(0.0) is None
    clock.now += 0.02
    assert times(intake.take(0.0)) == [1.0, 1.0, None] and intake.partial == 1
    intake.put(picture(2, 1.0))
    assert intake.take(0.0) is None and [one.late for one in intake.counts()] == [0, 0, 1]


def test_of_a_faster_camera_one_picture_a_frame_is_taken(clock):
    intake = made(clock, cameras=2, fewest=2)
    for moment in (0.0, 0.03, 0.1, 0.13):
        intake.put(picture(0, moment))
    for moment in (0.0, 0.1):
        intake.put(picture(1, moment))
    assert [times(intake.take(0.0)) for _ in range(2)] == [[0.0, 0.0], [0.1, 0.1]]
    assert intake.take(0.0) is None and [one.surplus for one in intake.counts()] == [2, 0]


def test_the_oldest_frame_is_dropped_of_all_cameras_and_counted(clock):
    intake = made(clock, buffer=2)
    for number in range(5):
        for camera in range(3):
            intake.put(picture(camera, number / 10))
    assert intake.dropped == 3 and intake.waiting == 2
    assert intake.notices() == (FramesDropped(3, 3),) and intake.notices() == ()
    assert [times(intake.take(0.0))[0] for _ in range(2)] == [0.3, 0.4]
    intake.put(picture(0, 0.2))
    assert intake.take(0.0) is None and intake.counts()[0].late == 1


def test_dropped_frames_are_told_at_once_then_now_and_then_and_all_at_the_end(clock):
    intake, told = made(clock, cameras=1, fewest=1, buffer=1, tell_s=2.0), []
    for number in range(41):
        clock.now = number / 10
        intake.put(picture(0, clock.now))
        told += intake.notices()
    intake.close()
    told += intake.notices()
    assert told == [FramesDropped(1, 1), FramesDropped(20, 21), FramesDropped(19, 40)]


def test_a_source_that_can_wait_loses_nothing(clock):
    intake = made(clock, cameras=1, fewest=1, buffer=2)
    given: list[float] = []

    def give() -> None:
        for number in range(20):
            while not intake.wait_for_room(0, 0.01):
                pass
            intake.put(picture(0, float(number)))
        intake.close()

    thread = threading.Thread(target=give)
    thread.start()
    while not intake.ended:
        taken = intake.take(0.01)
        if taken is not None:
            given.append(taken.time_s)
        clock.now += 0.01
    thread.join()
    assert given == [float(number) for number in range(20)] and intake.dropped == 0


def test_a_silent_camera_is_named_and_left_out_while_three_remain(clock):
    intake = made(clock, cameras=4, silent_s=2.0, buffer=50)
    told = []
    for number in range(25):
        clock.now += 0.1
        for camera in range(3):
            intake.put(picture(camera, number / 10))
        told += [(number, one) for one in intake.notices()]
    ((number, silent),) = told
    assert number in (19, 20) and silent.camera == 3 and silent.seconds == pytest.approx(2.0, abs=0.11)
    assert intake.counts()[3].silent and times(intake.take(0.0)) == [0.0, 0.0, 0.0, None]
    intake.put(picture(3, 3.0))
    assert intake.notices()[-1] == CameraBack(3)


def test_with_too_few_cameras_nothing_is_made_until_they_are_back(clock):
    intake = made(clock, silent_s=1.0)
    clock.now += 0.9
    for camera in (0, 1):
        intake.put(picture(camera, 0.0))
    clock.now += 0.5
    intake.put(picture(0, 0.5))
    silent, lacking = intake.notices()
    assert isinstance(silent, CameraSilent) and (silent.camera, silent.seconds) == (2, pytest.approx(1.4))
    assert lacking == CamerasLacking(2, 3) and intake.take(0.0) is None
    intake.put(picture(2, 0.5))
    assert intake.notices() == (CameraBack(2),)
    assert times(intake.take(0.0)) == [0.0, 0.0, None]


def test_a_camera_whose_clock_is_wrong_counts_as_silent(clock):
    intake = made(clock, silent_s=1.0, wait_s=0.0, fewest=2)
    for number in range(15):
        clock.now += 0.1
        for camera in (0, 1):
            intake.put(picture(camera, number / 10))
        intake.take(0.0)
        intake.put(picture(2, -50.0))
    assert [one.camera for one in intake.notices() if isinstance(one, CameraSilent)] == [2]
    assert intake.counts()[2].late == 15


def test_what_waits_at_the_end_is_taken_without_waiting(clock):
    intake = made(clock)
    intake.put(picture(1, 0.5))
    intake.note(SourceFailed(None, "gone", 1.0))
    intake.close()
    assert not intake.ended and times(intake.take(0.0)) == [None, 0.5, None] and intake.ended
    assert intake.take(5.0) is None and intake.notices() == (SourceFailed(None, "gone", 1.0),)


def test_what_an_earlier_service_made_is_not_made_again(clock):
    intake = Intake(3, 10.0, IntakeConfig(), after_s=1.05, clock=clock)
    for camera, moment in ((0, 0.0), (1, 1.0), (0, 1.1), (1, 1.1), (2, 1.1)):
        intake.put(picture(camera, moment))
    assert times(intake.take(0.0)) == [1.1, 1.1, 1.1] and [one.late for one in intake.counts()] == [1, 1, 0]


@pytest.mark.parametrize(
    ("settings", "named"),
    [
        ({"buffer": 0}, "buffer is 0"),
        ({"fewest": 0}, "fewest"),
        ({"silent_s": 0.0}, "silent_s"),
        ({"wait_s": -1.0}, "wait_s"),
    ],
)
def test_settings_that_cannot_work_are_named(settings, named):
    with pytest.raises(UserError, match=named):
        IntakeConfig(**settings)
