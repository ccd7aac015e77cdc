"""Objects without masks: what moves in several images at one place."""

from __future__ import annotations

import pickle
from dataclasses import replace

import jax
import numpy as np
import pytest
from support.cluttered_scenes import Flyer, Scene, circling
from support.cluttered_scenes import cluttered as with_clutter

from aerojax.capture.format import Capture, read_capture, write_capture_json
from aerojax.capture.frames import read_frames
from aerojax.capture.write import write_frame
from aerojax.classify.load import load_classifier
from aerojax.evaluate.segmentation import frame_score, segmentation_figures
from aerojax.pipeline.config import PipelineConfig
from aerojax.pipeline.offline import reconstruct_capture
from aerojax.pipeline.source import capture_preview
from aerojax.segment.base import Segmenter
from aerojax.segment.voxel_vote.member import VoxelVoteConfig

DARK = Flyer((0.6, 0.3, 0.2), (0.15, 0.15, 0.18), circling())
ORANGE = Flyer((0.3, 0.5, 0.15), (0.85, 0.3, 0.2), circling(1.5, phase=2.0, height=1.2))
FRAMES = range(0, 60, 3)
CAPTURES = (
    *("bird_animalia_cardinal", "bird_avian_flybird", "drone_crazyflie", "drone_px4_iris"),
    *("heli_bo105", "heli_r44", "plane_fg_cub", "plane_rc_cessna"),
)


def found_in(scene, frames=FRAMES, *, ahead=True, config=None):
    """Figures of the segmenter on a scene, the last state, and silhouettes of every frame."""
    segmenter, seen = (config or VoxelVoteConfig()).build(None), list(scene.frame_sets(frames))

    def preview(count, *, rgb, ids):
        for index in np.unique(np.linspace(0, len(seen) - 1, count).astype(int)):
            yield seen[index][0]

    state, scores, silhouettes = segmenter.initial(scene.network(), preview if ahead else None), [], []
    for frames_now, truth in seen:
        found, state = segmenter.step(frames_now, state)
        scores.append(frame_score(replace(frames_now, ids=tuple(truth)), found, least_span=8.0))
        silhouettes.append(found)
    return segmentation_figures(scores), state, silhouettes


def test_it_is_a_segmenter():
    assert isinstance(VoxelVoteConfig().build(None), Segmenter)


def test_two_objects_have_their_own_numbers_in_all_cameras_whatever_moves_behind():
    figures, _, silhouettes = found_in(with_clutter(Scene((DARK, ORANGE), cameras=5)))
    print(figures)
    assert figures["median_iou"] > 0.85 and figures["missed"] < 0.05
    assert figures["ghosts_in_100"] == 0 and figures["number_changes"] == 0
    assert {one.camera for one in silhouettes[5]} == set(range(5))


@pytest.mark.parametrize("ground", [{}, {"mottling": 0.0}, {"ground": (0.66, 0.78, 0.42)}], ids=["", "plain", "bright"])
def test_a_thrown_shadow_is_no_object(ground):
    figures, state, _ = found_in(Scene((DARK,), cameras=4, **ground))
    assert figures["ghosts_in_100"] == 0 and figures["median_iou"] > 0.85
    assert sum(not one.shadow for one in state.objects) == 1


def hovering(height):
    """An ellipsoid that drifts by a third of its length in ten frames and turns by nothing."""
    return replace(DARK, axes=(0.6, 0.6, 0.3), path=lambda frame: np.array([0.02 * frame, 0.03 * frame, height]))


def test_what_moves_less_than_its_length_is_found_whole_before_a_plain_sky():
    figures, _, _ = found_in(Scene((hovering(2.0),), cameras=4), range(10))
    print(figures)
    assert figures["median_iou"] > 0.8 and figures["missed"] < 0.1 and figures["ghosts_in_100"] == 0


def test_trees_before_two_of_five_cameras_hide_nothing_from_the_others():
    figures, _, silhouettes = found_in(Scene((DARK,), cameras=5, trees=(1, 3)))
    print(figures)
    assert figures["median_iou"] > 0.85 and figures["missed"] < 0.1 and figures["ghosts_in_100"] == 0
    assert all({one.camera for one in found} == {0, 2, 4} for found in silhouettes[1:]), "leaves are no silhouettes"


def test_trees_that_wave_before_three_cameras_are_nothing():
    _, _, silhouettes = found_in(Scene((), cameras=5, trees=(0, 1, 2)))
    assert not any(silhouettes)


def test_what_hovers_before_texture_and_clutter_makes_no_ghosts():
    bright = replace(hovering(-0.5), colour=ORANGE.colour)
    figures, _, _ = found_in(with_clutter(Scene((bright,), cameras=4)), range(10))
    print(figures)
    assert figures["missed"] < 0.8 and figures["ghosts_in_100"] == 0


def test_clutter_alone_is_nothing():
    _, _, silhouettes = found_in(with_clutter(Scene((), cameras=4)))
    assert not any(silhouettes)


def test_what_never_moves_is_not_invented():
    still = replace(DARK, path=lambda frame: np.array([0.5, 0.0, 0.8]))
    _, _, silhouettes = found_in(Scene((still,), cameras=4), FRAMES[:8])
    assert not any(silhouettes)


def test_a_stream_learns_its_background_first():
    config = VoxelVoteConfig()
    config = replace(config, background=replace(config.background, warm_up=13))
    figures, _, silhouettes = found_in(Scene((DARK,), cameras=4), range(0, 120, 4), ahead=False, config=config)
    assert not any(silhouettes[:13]) and all(silhouettes[16:])
    assert figures["ghosts_in_100"] == 0


def test_a_state_is_a_value_that_can_be_stored():
    scene = Scene((DARK,), cameras=3)
    segmenter = VoxelVoteConfig().build(None)
    seen = [frames for frames, _ in scene.frame_sets(FRAMES[:10])]

    def preview(count, *, rgb, ids):
        yield from seen

    state = segmenter.initial(scene.network(), preview)
    for frames in seen[:4]:
        _, state = segmenter.step(frames, state)
    stored = pickle.loads(pickle.dumps(state))
    first, _ = segmenter.step(seen[4], state)
    again, _ = segmenter.step(seen[4], state)
    restored, _ = segmenter.step(seen[4], stored)
    for other in (again, restored):
        assert len(first) == len(other) > 0
        for a, b in zip(first, other, strict=True):
            assert a.box == b.box and np.array_equal(a.coverage, b.coverage)


def test_a_mixture_finds_the_same_and_goes_on_from_its_last_state_only():
    scene, config = Scene((DARK,), cameras=3), VoxelVoteConfig()
    config = replace(config, background=replace(config.background, model="mixture"))
    figures, state, _ = found_in(scene, FRAMES[:12], config=config)
    assert figures["median_iou"] > 0.8 and figures["ghosts_in_100"] == 0
    segmenter = config.build(None)
    seen = [frames for frames, _ in scene.frame_sets(range(36, 36 + 4))]
    _, after = segmenter.step(seen[0], state)
    for frames in seen[1:]:
        _, after = segmenter.step(frames, after)
    with pytest.raises(RuntimeError, match="goes on from its last state"):
        segmenter.step(seen[0], state)


def test_a_camera_that_records_nothing_is_done_without():
    scene = Scene((DARK,), cameras=4)
    segmenter = VoxelVoteConfig().build(None)
    seen = [frames for frames, _ in scene.frame_sets(FRAMES[:12])]

    def preview(count, *, rgb, ids):
        yield from seen

    state = segmenter.initial(scene.network(), preview)
    for frames in seen[:3]:
        found, state = segmenter.step(replace(frames, rgb=(None, *frames.rgb[1:])), state)
    assert {one.camera for one in found} == {1, 2, 3}


@pytest.mark.long
@pytest.mark.parametrize("name", CAPTURES)
def test_reference_captures_without_their_masks(name, shared):
    folder = shared / "data/captures" / name
    if not folder.is_dir():
        pytest.skip(f"no capture at {folder}")
    capture, segmenter = read_capture(folder), VoxelVoteConfig().build(None)
    state, scores = segmenter.initial(capture.cameras, capture_preview(capture)), []
    for frame in range(capture.frames):
        frames = read_frames(capture, frame)
        found, state = segmenter.step(replace(frames, ids=(None,) * len(frames.ids)), state)
        scores.append(frame_score(frames, found))
    figures = segmentation_figures(scores)
    print(name, figures)
    assert figures["median_iou"] >= 0.75 and figures["missed"] < 0.05 and figures["ghosts_in_100"] < 5


@pytest.mark.long
def test_a_capture_without_masks_is_classified(tmp_path):
    scene = Scene((DARK,), cameras=4)
    cameras = tuple(replace(one, rgb=f"{one.name}/rgb/{{frame:06d}}.png") for one in scene.network())
    for frames, _ in scene.frame_sets(range(0, 60, 3)):
        for camera, image in zip(cameras, frames.rgb, strict=True):
            write_frame(tmp_path, camera, frames.frame // 3, image.astype(np.float64), None)
    write_capture_json(Capture(tmp_path, 10.0, 20, cameras, None))
    config = PipelineConfig(segment=VoxelVoteConfig())
    clip = reconstruct_capture(read_capture(tmp_path), config, load_classifier(), key=jax.random.key(0))
    assert len(clip.frames) >= 18 and not clip.warnings
    off = [np.linalg.norm(place - DARK.path(3 * f)) for f, place in zip(clip.frames, clip.position, strict=True)]
    assert max(off) < 0.25
    assert np.exp(clip.log_probabilities[-1]).sum() == pytest.approx(1.0, abs=1e-5)
