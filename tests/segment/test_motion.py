"""What moves before a background."""

from __future__ import annotations

import numpy as np
import pytest
from support.networks import frame_sets, mask_of, network, position_at

from aerojax.capture.format import read_capture
from aerojax.capture.frames import read_mask, read_rgb
from aerojax.segment.motion import FEWEST_IMAGES, PREVIEWED, Background, MotionConfig, background, motion_mask


def scene(seed=0, noise=0.0):
    rng = np.random.default_rng(seed)
    still = rng.uniform(0.2, 0.8, (60, 80, 3)).astype(np.float32)
    return still, lambda: (noise * rng.normal(size=still.shape)).astype(np.float32)


def test_background_is_what_does_not_move():
    still, _ = scene()
    frames = []
    for step in range(7):
        frame = still.copy()
        frame[20:30, 10 * step : 10 * step + 10] = 1.0
        frames.append(frame)
    np.testing.assert_allclose(background(frames), still)


def test_a_block_is_found_and_the_smaller_one_left_out():
    still, _ = scene()
    image = still.copy()
    image[20:32, 30:50] = 1.0
    image[5:9, 5:9] = 1.0
    found = motion_mask(image, still)
    assert found.dtype == np.uint16 and set(np.unique(found)) == {0, 1}
    block = np.zeros((60, 80), bool)
    block[20:32, 30:50] = True
    assert (found[block] == 1).mean() > 0.98
    assert (found[~block] == 1).sum() < 0.15 * block.sum()  # a rim from the smoothing at most


def test_nothing_moves():
    still, _ = scene()
    assert not motion_mask(still, still).any()


def test_noise_raises_the_threshold():
    still, noise = scene(noise=0.05)
    image = np.clip(still + noise(), 0, 1)
    image[20:32, 30:50] = 1.0
    found = motion_mask(image, still)
    assert found[22:30, 32:48].mean() > 0.7
    assert found[:15].sum() == 0


def overlap(name, shared):
    """Median IoU of motion masks with the capture's own, over cameras and some frames."""
    folder = shared / "data/captures" / name
    if not folder.is_dir():
        pytest.skip(f"no capture at {folder}")
    capture, values = read_capture(folder), []
    for camera in range(len(capture.cameras)):
        frames = np.unique(np.linspace(0, capture.frames - 1, 15).astype(int))
        still = background([read_rgb(capture, camera, int(f)) for f in frames])
        for frame in (0, capture.frames // 2, capture.frames - 1):
            truth = read_mask(capture, camera, frame) > 0
            found = motion_mask(read_rgb(capture, camera, frame), still) > 0
            values.append(np.count_nonzero(truth & found) / np.count_nonzero(truth | found))
    print(f"{name}: motion masks' median IoU {np.median(values):.3f}, least {min(values):.3f}")
    return float(np.median(values))


@pytest.mark.parametrize("name", ["bird_animalia_cardinal", "plane_rc_cessna"])
def test_motion_masks_on_reference_captures(shared, name):
    assert overlap(name, shared) >= 0.6


def test_a_background_forms_as_frames_pass_in_constant_memory():
    still, _ = scene()
    known, kept = Background(), []
    for step in range(200):
        image = still.copy()
        left = 3 * step % 70
        image[20:30, left : left + 8] = 1.0
        known = known.after(image)
        kept.append(len(known.images))
        if step + 1 < FEWEST_IMAGES:
            assert known.still is None
    assert max(kept) <= PREVIEWED + 1
    np.testing.assert_allclose(known.still, still, atol=1 / 255)


def test_a_stream_without_masks_finds_the_object_once_there_is_a_background():
    cameras = network(3)
    segmenter = MotionConfig().build(None)
    state, seen = segmenter.initial(cameras), []
    for frames in frame_sets(cameras, range(0, 80, 4), masks=False):
        found, state = segmenter.step(frames, state)
        seen.append(found)
    assert not any(seen[: FEWEST_IMAGES - 1])
    truth = [mask_of(camera, position_at(76)) for camera in cameras]
    for one in seen[-1]:
        both = np.count_nonzero((one.coverage > 0.5) & truth[one.camera])
        assert both / np.count_nonzero((one.coverage > 0.5) | truth[one.camera]) > 0.8
    assert len(seen[-1]) == 3
