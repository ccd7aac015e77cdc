"""Masks where there are masks, motion where there are none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from support.networks import frame_sets, mask_of, network, position_at

from aerojax.segment.auto import AutoConfig


def previewed(cameras, frames):
    """A preview of these frames, and a list of what it was asked for."""
    asked = []

    def preview(count, *, rgb, ids):
        asked.append((rgb, ids))
        for index in np.unique(np.linspace(0, len(frames) - 1, count).astype(int)):
            yield frames[index]

    return preview, asked


def test_motion_serves_the_camera_without_masks():
    cameras = network(3)
    cameras = (*cameras[:2], replace(cameras[2], mask=None))
    frames = [replace(f, ids=(*f.ids[:2], None)) for f in frame_sets(cameras, range(0, 80, 5))]
    preview, asked = previewed(cameras, frames)
    segmenter = AutoConfig().build(None)
    found, state = segmenter.step(frames[8], segmenter.initial(cameras, preview))
    assert [one.camera for one in found] == [0, 1, 2] and {one.object_id for one in found} == {3}
    assert state.object_id == 3 and (True, False) in asked
    truth = mask_of(cameras[2], position_at(40))
    overlap = np.count_nonzero((found[2].coverage > 0.5) & truth) / np.count_nonzero((found[2].coverage > 0.5) | truth)
    assert overlap > 0.8


def test_images_are_not_previewed_where_every_camera_has_masks():
    cameras = network(3)
    frames = list(frame_sets(cameras, range(6)))
    preview, asked = previewed(cameras, frames)
    segmenter = AutoConfig().build(None)
    segmenter.initial(cameras, preview)
    assert asked == [(False, True)]
