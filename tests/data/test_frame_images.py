"""Whole images of sequences: sizes, boxes, windows that begin before the recording, and draws by name alone."""

from __future__ import annotations

import dataclasses

import cv2
import numpy as np
import pytest
from support.broken_captures import FRAMES, HEIGHT, WIDTH, frame_images, make_good
from support.dataset_entries import sequence

from aerojax.core.errors import UserError
from aerojax.core.types import CLASSES
from aerojax.data.frame_images import ImageChoice, read_frame_images
from aerojax.geometry.boxes import tight_box

SIZE = (HEIGHT // 2, WIDTH // 2)


@pytest.fixture(scope="module")
def entries(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sequences")
    made = []
    for name, label in (("a", "drone"), ("b", "bird")):
        make_good(folder / name)
        made.append(dataclasses.replace(sequence(name, label, "train", FRAMES), folder=folder / name))
    return made


def test_images_are_those_of_the_capture_made_smaller(entries):
    found = read_frame_images(entries, ImageChoice(frames=FRAMES), size=SIZE, window=1, seed=0)
    assert found.images.shape == (2 * 3 * FRAMES, 1, *SIZE, 3)
    for index in range(len(found.label)):
        rgb, mask, _ = frame_images(int(found.camera[index]), int(found.frame[index]))
        small = cv2.resize(rgb.astype(np.float32), SIZE[::-1], interpolation=cv2.INTER_AREA)
        assert np.abs(found.images[index, 0].astype(float) - small).max() <= 0.51
        box = tight_box(mask == 1)
        assert found.seen[index] == (box is not None)
        if box is not None:
            np.testing.assert_allclose(found.box[index], np.array(box) / 2)
            assert found.width_px[index] == max(box[2] - box[0], box[3] - box[1])
    assert found.seen.any()
    np.testing.assert_array_equal(found.label, [CLASSES.index(("drone", "bird")[i]) for i in found.sequence])


def test_windows_end_with_their_frame(entries):
    single = read_frame_images(entries[:1], ImageChoice(frames=FRAMES), size=SIZE, window=1, seed=0)
    stacked = read_frame_images(entries[:1], ImageChoice(frames=FRAMES), size=SIZE, window=3, seed=0)
    for index in range(len(stacked.label)):
        for back in range(3):
            same = (single.camera == stacked.camera[index]) & (single.frame == max(stacked.frame[index] - back, 0))
            np.testing.assert_array_equal(stacked.images[index, 2 - back], single.images[same][0, 0])


def test_draws_depend_on_the_name_alone(entries):
    choice = ImageChoice(cameras=1)
    both = read_frame_images(entries, choice, size=SIZE, window=1, seed=3)
    alone = read_frame_images(entries[1:], choice, size=SIZE, window=1, seed=3)
    np.testing.assert_array_equal(both.images[1], alone.images[0])
    drawn = {int(read_frame_images(entries[:1], choice, size=SIZE, window=1, seed=s).camera[0]) for s in range(12)}
    assert len(drawn) > 1


def test_what_chooses_nothing_is_refused(entries):
    with pytest.raises(UserError, match="no sequences"):
        read_frame_images([], ImageChoice(), size=SIZE, window=1, seed=0)
    with pytest.raises(UserError, match="frames"):
        ImageChoice(frames=0)
