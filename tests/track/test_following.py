"""Births, beliefs, coasting, deaths, crossings, cameras that are not synchronised, restarts."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
from support.flights import Scene, frames_of, path, ring, scene, watch

from aerojax.core.errors import UserError
from aerojax.evaluate.tracking import tracking_figures
from aerojax.track.following import FollowingConfig, FollowingState, follow_scan
from aerojax.track.following import _assigned as assigned
from aerojax.track.offline import NOBODY, Following, follow, suited
from aerojax.track.sights import Detections, scans_of
from aerojax.track.state_files import read_state, state_from_json, state_to_json, write_state

CONFIG = FollowingConfig()


def tracked(made: Scene, config: FollowingConfig = CONFIG) -> Following:
    return follow(made.watching.detections, made.cameras, config)


@pytest.mark.parametrize("seed", [2, 3])
def test_crossings_keep_their_numbers(seed):
    """Four and five objects, two of which pass within 1.5 m; missed, merged and false detections."""
    made = scene(seed, seconds=4.0)
    figures = tracking_figures(frames_of(tracked(made), made.paths))
    assert figures.idf1 >= 0.97 and figures.switches == 0 and figures.ghosts < 1 and figures.rmse < 0.1


@pytest.mark.long
@pytest.mark.parametrize("stagger", [False, True])
def test_twenty_scenes(stagger):
    figures = []
    for seed in range(20):
        made = scene(seed, stagger=stagger)
        figures.append(tracking_figures(frames_of(tracked(made), made.paths)))
    assert min(one.idf1 for one in figures) >= 0.95
    assert max(one.ghosts for one in figures) < 1


def test_cameras_need_not_be_synchronised():
    made = scene(1, seconds=3.0, stagger=True)
    figures = tracking_figures(frames_of(tracked(made), made.paths))
    assert figures.idf1 >= 0.97 and figures.rmse < 0.12


def test_sights_are_owned_by_the_track_of_their_object():
    made = scene(2, seconds=2.0)
    done = tracked(made)
    source = made.watching.source
    for number in range(len(made.paths)):
        of = source[done.owner == number]
        assert len(of) > 100 and np.mean(of == np.bincount(of[of >= 0]).argmax()) > 0.98
    assert np.mean(done.owner[source == -1] == NOBODY) > 0.97


def lone(seconds: float = 2.0, **how) -> Scene:
    rng = np.random.default_rng(5)
    cameras, one = ring(4), (path(rng),)
    return Scene(cameras, one, watch(one, cameras, seconds=seconds, rng=rng, **{"missed": 0.0, "clutter": 0.0, **how}))


def statuses(done: Following) -> list[str]:
    return [moment.tracks[0].status if moment.tracks else "-" for moment in done.moments]


def test_belief_needs_three_of_five_rounds():
    assert statuses(tracked(lone()))[:4] == ["tentative", "tentative", "confirmed", "confirmed"]
    many = dataclasses.replace(CONFIG, confirm_hits=5)
    assert statuses(tracked(lone(), many))[:5] == ["tentative"] * 4 + ["confirmed"]


def test_what_is_hidden_coasts_and_keeps_its_number():
    made = lone(blackout=(0.5, 0.9))
    done = tracked(made)
    assert statuses(done)[14] == "confirmed" and len(done.moments) == 60 - 12  # nobody says anything meanwhile
    assert {one.number for moment in done.moments for one in moment.tracks} == {0}
    noisy = dataclasses.replace(
        made, watching=watch(made.paths, made.cameras, seconds=2.0, rng=np.random.default_rng(0), blackout=(0.5, 0.9))
    )
    done = tracked(noisy)
    assert statuses(done)[18:24] == ["coasting"] * 6 and statuses(done)[32] == "confirmed"
    assert {one.number for moment in done.moments for one in moment.tracks} == {0}


def test_what_is_gone_for_long_is_lost_and_comes_back_as_another():
    made = lone(3.0, blackout=(0.5, 2.0), clutter=1.0)
    done = tracked(made)
    assert {one.number for moment in done.moments for one in moment.tracks} == {0, 1}
    assert not any(moment.tracks for moment in done.moments if 1.6 < moment.time_s < 1.95)


def test_silence_is_as_long_as_a_gap():
    done = tracked(lone(2.5, blackout=(0.5, 2.0)))
    assert {one.number for moment in done.moments for one in moment.tracks} == {0, 1}
    assert done.state.numbers == 2 and len(done.state.tracks) == 1


def test_false_detections_alone_are_no_track():
    cameras = ring(5)
    seen = watch(
        [path(np.random.default_rng(0))], cameras, seconds=2.0, rng=np.random.default_rng(0), missed=1.0, clutter=4.0
    )
    assert not any(moment.tracks for moment in follow(seen.detections, cameras, CONFIG).moments)


def test_restart_goes_on_with_the_same_bits(tmp_path):
    made = scene(2, seconds=2.0)
    every, whole = made.watching.detections, tracked(made)
    early = every.stamp_s < 1.0
    first = follow(every.chosen(early), made.cameras, CONFIG)
    names = tuple(camera.name for camera in made.cameras)
    write_state(tmp_path / "state.json", first.state, names)
    second = follow(every.chosen(~early), made.cameras, CONFIG, state=read_state(tmp_path / "state.json", names))
    joined = [*first.moments, *second.moments]
    assert [m.time_s for m in joined] == [m.time_s for m in whole.moments]
    for ours, theirs in zip(joined[40:], whole.moments[40:], strict=True):
        assert [(o.number, o.mean.tolist()) for o in ours.tracks] == [
            (o.number, o.mean.tolist()) for o in theirs.tracks
        ]
    again = state_to_json(second.state)
    assert state_to_json(state_from_json(json.loads(json.dumps(again)))) == again
    with pytest.raises(UserError, match="same cameras"):
        read_state(tmp_path / "state.json", names[::-1])
    (tmp_path / "state.json").write_text('{"format": "aerojax-track-state"}')
    with pytest.raises(UserError, match="is no aerojax-track-state"):
        read_state(tmp_path / "state.json", names)


def test_a_scan_of_the_past_is_refused():
    made = lone()
    scans = scans_of(made.watching.detections, made.cameras, CONFIG.noise)
    _, state = follow_scan(scans[8], FollowingState(), made.cameras, CONFIG)
    with pytest.raises(ValueError, match="after one of"):
        follow_scan(scans[0], state, made.cameras, CONFIG)


def test_a_track_that_is_known_well_is_preferred():
    """The sight is nearer, in deviations, to the track that could be anywhere."""
    distance, log_spread = np.array([[4.0], [0.5]]), np.array([[1.0], [9.0]])
    assert assigned(distance, log_spread, 0.99)[0].tolist() == [0]
    assert assigned(distance, np.ones((2, 1)), 0.99)[0].tolist() == [1]
    assert assigned(np.full((2, 1), 50.0), log_spread, 0.99)[0].tolist() == []


def test_rounds_last_as_long_as_the_slowest_camera_needs():
    stamps = np.concatenate([np.arange(20) / 60, np.arange(10) / 30])
    mixed = Detections(np.repeat([0, 1], [20, 10]), stamps, np.zeros((30, 2)), np.zeros(30))
    assert suited(CONFIG, mixed).round_s == pytest.approx(0.9 / 30)
    assert suited(CONFIG, mixed).window_s == CONFIG.window_s == 0.05
    assert suited(CONFIG, mixed.chosen(mixed.camera == 0)) == CONFIG
    slow = dataclasses.replace(mixed, stamp_s=6 * stamps).chosen(mixed.camera == 1)
    assert suited(CONFIG, slow).round_s == 0 and suited(CONFIG, slow).window_s == pytest.approx(0.24)


def test_configurations_that_make_no_sense():
    for wrong in ({"confirm_rounds": 2}, {"confidence": 1.0}, {"hold_views": 0}):
        with pytest.raises(UserError):
            dataclasses.replace(CONFIG, **wrong)
