"""A recording is played at its rate or as fast as it is taken, again and again, and from where it was left."""

from __future__ import annotations

import threading
import time

import pytest
from support.live_sites import write_frames, write_site
from support.networks import network

from aerojax.core.errors import UserError
from aerojax.serve.intake import Intake, IntakeConfig
from aerojax.serve.sources.playback import PlaybackConfig


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = write_site(tmp_path_factory.mktemp("played") / "site", network(3), frames=4, fps=50.0)
    write_frames(place, network(3), range(4))
    return place


def played(folder, config, since=None, buffer=2) -> tuple[list, Intake, float]:
    source = config.build(folder)
    intake, begin = Intake(3, 50.0, IntakeConfig(buffer=buffer)), time.monotonic()

    def run() -> None:
        source.run(intake, since or {}, threading.Event())
        intake.close()

    thread = threading.Thread(target=run)
    thread.start()
    found = []
    while not intake.ended:
        taken = intake.take(0.05)
        found += [] if taken is None else [taken.pictures]
    thread.join()
    return found, intake, time.monotonic() - begin


def test_as_fast_as_it_is_taken_nothing_is_dropped_and_times_go_on(folder):
    found, intake, _ = played(folder, PlaybackConfig(rate=0.0, repeat=3))
    assert [[one.number for one in frame] for frame in found] == [[n] * 3 for n in range(12)] and intake.dropped == 0
    assert found[9][1].time_s == pytest.approx(9 / 50)
    assert (found[9][0].load()[0] == found[1][0].load()[0]).all()


def test_at_its_rate_it_takes_its_time(folder):
    found, _, seconds = played(folder, PlaybackConfig(rate=0.5), buffer=9)
    assert len(found) == 4 and seconds >= 3 / 25


def test_it_goes_on_where_it_was_left(folder):
    found, _, _ = played(folder, PlaybackConfig(rate=0.0, repeat=2), since={0: 5, 1: 5})
    assert [frame[0].number for frame in found] == [6, 7]


def test_one_that_is_told_to_stop_does(folder):
    source, stop = PlaybackConfig(rate=0.0, repeat=0).build(folder), threading.Event()
    thread = threading.Thread(target=source.run, args=(Intake(3, 50.0, IntakeConfig(buffer=1)), {}, stop))
    thread.start()
    stop.set()
    thread.join(timeout=5)
    assert not thread.is_alive()


def test_whether_it_may_be_looked_at_before(folder):
    assert PlaybackConfig(look_ahead=False).build(folder).preview() is None
    preview = PlaybackConfig().build(folder).preview()
    assert preview is not None and [one.frame for one in preview(2, rgb=True, ids=False)] == [0, 3]


def test_a_rate_below_zero_is_named():
    with pytest.raises(UserError, match="rate is -1"):
        PlaybackConfig(rate=-1.0)
