"""Several objects behind the tracker's door: each silhouette at its own track, through a crossing and at borders."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.networks import HEIGHT, WIDTH, mask_of, network

from aerojax.core.types import FrameSet, Silhouette
from aerojax.geometry.cameras import project_points
from aerojax.segment.instances import InstancesConfig
from aerojax.track.following import FollowingConfig
from aerojax.track.several import SeveralConfig
from aerojax.track.sights import NoiseConfig

CAMERAS = network(4)
CONFIG = SeveralConfig(following=FollowingConfig(noise=NoiseConfig(outline=0.03)))


def places(frame: int) -> np.ndarray:
    """Two objects that pass each other at 0.6 m."""
    x = 0.06 * (frame - 10)
    return np.array([[x, 0.3, 0.1], [-x, -0.3, -0.1]])


def silhouettes(frame: int, *, cut: int | None = None) -> list[Silhouette]:
    """Boxes about both, whose ids differ from camera to camera; camera `cut` shows the first one in part."""
    found = []
    for index, camera in enumerate(CAMERAS):
        for number, (u, v) in enumerate(project_points(places(frame), camera).tolist()):
            partial = cut == index and number == 0
            box = (u - 9, v - 5, u - 3, v + 5) if partial else (u - 9, v - 5, u + 9, v + 5)
            found.append(Silhouette(index, (number + index) % 2, np.zeros((1, 1), np.float32), box, whole=not partial))
    return found


def frame_of(frame: int) -> FrameSet:
    return FrameSet(frame, frame / 30, (None,) * 4, (None,) * 4)


def test_each_silhouette_is_of_its_own_object():
    tracker = CONFIG.build()
    state, told = tracker.initial(CAMERAS), []
    for frame in range(20):
        tracks, state = tracker.step(frame_of(frame), silhouettes(frame), state)
        told.append(tracks)
    assert [len(tracks) for tracks in told] == [0, 0, *[2] * 18]
    first = {one.number: int(np.argmin(np.linalg.norm(places(2) - one.position, axis=1))) for one in told[2]}
    for frame, tracks in list(enumerate(told))[2:]:
        for one in tracks:
            assert np.linalg.norm(one.position - places(frame)[first[one.number]]) < 0.1
            ids = [(s.object_id - s.camera) % 2 for s in one.silhouettes if s is not None]
            assert ids == [first[one.number]] * 4
    assert abs(told[-1][first[0]].velocity[0]) == pytest.approx(1.8, abs=0.3)


def test_what_the_border_cuts_goes_to_the_track_that_is_expected_there():
    tracker, state = CONFIG.build(), CONFIG.build().initial(CAMERAS)
    for frame in range(6):
        tracks, state = tracker.step(frame_of(frame), silhouettes(frame, cut=1 if frame == 5 else None), state)
    near = min(tracks, key=lambda one: float(np.linalg.norm(one.position - places(5)[0])))
    held = near.silhouettes[1]
    assert held is not None and not held.whole and np.linalg.norm(near.position - places(5)[0]) < 0.1


def test_where_nobody_sees_anything_there_is_no_track():
    tracker, state = CONFIG.build(), CONFIG.build().initial(CAMERAS)
    for frame in range(4):
        _, state = tracker.step(frame_of(frame), silhouettes(frame), state)
    tracks, after = tracker.step(frame_of(4), [], state)
    assert tracks == [] and after is state
    tracks, _ = tracker.step(frame_of(5), silhouettes(5), after)
    assert [one.number for one in tracks] == [0, 1]


def flapping(frame: int) -> list[Silhouette]:
    """One object that sails and then beats its wings: the middle of its outline leaps, for all cameras alike."""
    place = np.array([[0.03 * frame, 0.0, 0.0]])
    found = []
    for index, camera in enumerate(CAMERAS):
        u, v = project_points(place, camera)[0].tolist()
        v += 0 if frame < 8 else (-4, 4)[frame % 2]
        box = (u - 14, v - 9, u + 14, v + 9)
        found.append(Silhouette(index, 1, np.zeros((1, 1), np.float32), box, whole=True))
    return found


@pytest.mark.parametrize("shape", [0.1, 0.0])
def test_wings_that_beat_are_one_object(shape):
    """Expected as the outline's motion; and where the gate is too narrow for it, what begins there is no other one."""
    noise = NoiseConfig(outline=0.01, shape=shape)
    tracker = SeveralConfig(following=FollowingConfig(noise=noise)).build()
    state, numbers = tracker.initial(CAMERAS), []
    for frame in range(30):
        tracks, state = tracker.step(frame_of(frame), flapping(frame), state)
        numbers.append([one.number for one in tracks])
        if frame > 20 and shape:
            assert np.linalg.norm(tracks[0].position - [0.03 * frame, 0, 0]) < 0.05
    assert {tuple(one) for one in numbers[3:]} <= ({(0,)} if shape else {(0,), ()})
    assert state.following.numbers == 1


def test_another_one_close_by_is_another_one():
    """Within the size of the first, but images show both."""
    tracker, state = CONFIG.build(), CONFIG.build().initial(CAMERAS)
    for frame in range(16):
        places = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.2]])[: 1 if frame < 8 else 2]
        shown = []
        for index, camera in enumerate(CAMERAS):
            for u, v in project_points(places, camera).tolist():
                box = (u - 9, v - 3, u + 9, v + 3)
                shown.append(Silhouette(index, len(shown), np.zeros((1, 1), np.float32), box, whole=True))
        tracks, state = tracker.step(frame_of(frame), shown, state)
    assert [one.number for one in tracks] == [0, 1]
    assert np.linalg.norm(tracks[0].position - tracks[1].position) < max(one.size_m for one in state.following.tracks)


def test_instances_of_masks_are_silhouettes():
    masks = []
    for camera in CAMERAS:
        ids = np.zeros((HEIGHT, WIDTH), np.uint16)
        for number, place in enumerate(places(0)):
            ids[mask_of(camera, place)] = 7 + number
        masks.append(ids)
    frames = FrameSet(0, 0.0, (None,) * 4, (*masks[:3], None))
    segmenter = InstancesConfig().build(None)
    found, _ = segmenter.step(frames, segmenter.initial(CAMERAS))
    assert [(one.camera, one.object_id) for one in found] == [(c, n) for c in range(3) for n in (7, 8)]
    assert all(one.coverage.sum() == np.count_nonzero(masks[one.camera] == one.object_id) for one in found)
    alone, _ = replace(segmenter, object_id=8).step(frames, None)
    assert [one.object_id for one in alone] == [8, 8, 8]
