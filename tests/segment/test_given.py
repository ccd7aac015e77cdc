"""Masks of the capture: which object to follow, and its silhouettes."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from support.networks import frame_sets, mask_of, network, position_at

from aerojax.core.errors import UserError
from aerojax.segment.given import PREVIEWED, GivenConfig, choose_object
from aerojax.segment.silhouettes import silhouette_of


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


def test_a_stream_follows_the_largest_instance_of_its_first_masks():
    cameras = network(3)
    frames = list(frame_sets(cameras, range(3), blind=(0,)))
    segmenter = GivenConfig().build(None)
    nothing, state = segmenter.step(frames[0], segmenter.initial(cameras))
    assert nothing == [] and state is None
    found, state = segmenter.step(frames[1], state)
    assert state == 3 and [one.camera for one in found] == [0, 1, 2]
    np.testing.assert_array_equal(found[1].coverage, mask_of(cameras[1], position_at(1)))
    other, _ = GivenConfig().build(7).step(frames[1], 7)
    assert other == []


def brief_preview(cameras, frames, shown):
    """A preview of a capture in which the object is visible in some frames only, and what it was asked for."""
    asked = []

    def preview(count, *, rgb, ids):
        asked.append(count)
        for index in np.unique(np.linspace(0, frames - 1, count).astype(int)):
            hidden = () if index in shown else (int(index),)
            yield from frame_sets(cameras, range(int(index), int(index) + 1), blind=hidden)

    return preview, asked


@pytest.mark.parametrize(("frames", "shown"), [(12, (3, 4)), (12, (10,)), (70, (33,))])
@pytest.mark.parametrize("object_id", [None, 3])
def test_an_object_that_is_seen_briefly_is_found(frames, shown, object_id):
    cameras = network(3)
    preview, asked = brief_preview(cameras, frames, shown)
    assert GivenConfig().build(object_id).initial(cameras, preview) == 3
    assert asked[0] == PREVIEWED and len(asked) > 1


def test_one_look_is_enough_where_a_few_frames_show_the_object():
    cameras = network(3)
    preview, asked = brief_preview(cameras, 40, range(40))
    assert GivenConfig().build(None).initial(cameras, preview) == 3 and asked == [PREVIEWED]


def test_an_object_in_no_frame_is_said_to_be_absent_after_all_were_looked_at():
    cameras = network(3)
    preview, asked = brief_preview(cameras, 12, ())
    with pytest.raises(UserError, match="every mask of the capture is empty"):
        GivenConfig().build(None).initial(cameras, preview)
    assert asked[-1] > 12


def test_shades_of_a_picture_are_the_silhouettes_coverage():
    cameras = network(3)
    (frames,) = frame_sets(cameras, range(1))
    masks = [mask_of(camera, position_at(0)) for camera in cameras]
    soft = tuple(cv2.GaussianBlur(mask.astype(np.float32), (0, 0), 1.0) for mask in masks)
    shaded = replace(frames, ids=tuple(mask.astype(np.uint16) for mask in masks), coverage=soft)
    found, _ = GivenConfig().build(None).step(shaded, None)
    for one, share in zip(found, soft, strict=True):
        np.testing.assert_array_equal(one.coverage, share)


def test_a_silhouette_knows_its_box_and_whether_it_is_cut():
    coverage = np.zeros((20, 30), np.float32)
    coverage[5:9, 4:10] = 1.0
    coverage[4, 4:10] = 0.4  # less than half
    one = silhouette_of(2, 5, coverage)
    assert one is not None and one.box == (4.0, 5.0, 10.0, 9.0) and one.whole
    assert (one.camera, one.object_id) == (2, 5)
    coverage[5:9, :10] = 1.0
    cut = silhouette_of(2, 5, coverage)
    assert cut is not None and not cut.whole
    assert silhouette_of(0, 1, np.zeros((20, 30), np.float32)) is None
    speck = np.zeros((20, 30), np.float32)
    speck[3, 3:6] = 1.0
    assert silhouette_of(0, 1, speck) is None
