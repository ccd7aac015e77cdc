"""Masks: which object to follow, and what moves before a background."""

from __future__ import annotations

import numpy as np
import pytest

from aerojax.capture.format import read_capture
from aerojax.capture.frames import read_mask, read_rgb
from aerojax.core.errors import UserError
from aerojax.segment.given import choose_object
from aerojax.segment.motion import background, motion_mask


def labelled(*areas):
    """A 20×20 mask whose instance i + 1 covers areas[i] pixels."""
    flat = np.zeros(400, np.uint16)
    flat[: sum(areas)] = np.repeat(np.arange(1, len(areas) + 1), areas)
    return flat.reshape(20, 20)


def test_the_largest_object_is_followed():
    assert choose_object([labelled(5, 60, 20)], None) == 2
    assert choose_object(iter([labelled(5, 60), labelled(100), labelled(0, 0, 30)]), None) == 1
    assert choose_object([labelled(5, 60)], 1) == 1


def test_instances_are_counted_over_all_masks():
    large = np.full((20, 20), 900, np.uint16)
    assert choose_object([labelled(399), large], None) == 900
    assert choose_object([large, labelled(399)], None) == 900


def test_an_absent_object_is_named_with_those_present():
    with pytest.raises(UserError, match=r"object=7 appears in no mask of the capture; present: 1, 3"):
        choose_object([labelled(5, 0, 20)], 7)
    with pytest.raises(UserError, match=r"object=2 .* present: 1, 3"):
        choose_object([labelled(5, 0, 20)], 2)
    with pytest.raises(UserError, match="object=0 appears in no mask"):
        choose_object([labelled(5)], 0)


@pytest.mark.parametrize("object_id", [-1, -3])
def test_a_negative_object_is_refused(object_id):
    with pytest.raises(UserError, match=f"object={object_id} "):
        choose_object([labelled(5, 6, 7)], object_id)


def test_empty_masks_are_said_to_be_empty():
    with pytest.raises(UserError, match="every mask of the capture is empty"):
        choose_object([labelled()], None)
    with pytest.raises(UserError, match="present: none"):
        choose_object([], 3)


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
