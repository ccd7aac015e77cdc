"""Where crops of cut views look, and which of their pixels lie in the image."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.cut_views import aimed_aside
from support.networks import frame_sets, network, position_at

from aerojax.geometry.cameras import project_points
from aerojax.reconstruct.cut_views import SeenBoxes, aimed_boxes, centre_on_ray, known_pixels
from aerojax.reconstruct.observe import observe
from aerojax.segment.given import GivenConfig

SIZE = 48
FRAME, CUT = 4, 2


def shown_by(cameras):
    """What the cameras record, and the silhouettes."""
    frames = next(frame_sets(cameras, range(FRAME, FRAME + 1)))
    return frames, GivenConfig().build(3).step(frames, 3)[0]


@pytest.fixture(scope="module")
def column():
    """Of the third camera's image at the object's middle."""
    box = shown_by(network())[1][CUT].box
    return int((box[0] + box[2]) / 2)


def seen_boxes(cameras, boxes, whole, cut):
    K, poses = np.stack([c.K for c in cameras]), np.stack([c.world_from_cam for c in cameras])
    sizes = np.array([(c.width, c.height) for c in cameras], float)
    return SeenBoxes(K, poses, sizes, np.array(boxes, float), whole, cut)


def aimed(cameras, boxes, *, cut, centre=None):
    whole = np.arange(len(cameras)) != CUT
    seen = seen_boxes(cameras, boxes, whole, ~whole & cut)
    return aimed_boxes(seen, position_at(FRAME) if centre is None else centre)


def test_a_cut_view_looks_at_the_whole_object(column):
    narrow = aimed_aside(network(), CUT, column)
    whole, part = ([one.box for one in shown_by(cameras)[1]] for cameras in (network(), narrow))
    found, used = aimed(narrow, part, cut=True)
    np.testing.assert_array_equal(used, np.arange(4) == CUT)
    np.testing.assert_array_equal(np.delete(found, CUT, 0), np.delete(whole, CUT, 0))
    x0, y0, x1, y1 = found[CUT]
    np.testing.assert_allclose([(x0 + x1) / 2, (y0 + y1) / 2], project_points(position_at(FRAME), narrow[CUT]))
    true = np.array(whole[CUT]) - [column, 0, column, 0]
    assert x0 <= true[0] + 1 and y0 <= true[1] + 1 and x1 >= true[2] - 1 and y1 >= true[3] - 1
    assert x1 - x0 == pytest.approx(y1 - y0) and x1 - x0 < 40  # as wide as from where it is widest


def test_what_does_not_fit_is_not_used():
    cameras = network()
    boxes = [one.box for one in shown_by(cameras)[1]]
    elsewhere = [*boxes[:CUT], (0.0, 2.0, 9.0, 9.0), *boxes[CUT + 1 :]]
    assert not aimed(cameras, elsewhere, cut=True)[1].any()
    assert aimed(cameras, boxes, cut=True)[1].any() and not aimed(cameras, boxes, cut=False)[1].any()
    behind = cameras[CUT].world_from_cam[:3, 3] * 1.5
    found, used = aimed(cameras, boxes, cut=True, centre=behind)
    assert not used.any() and np.isfinite(found).all()


@pytest.mark.parametrize("cut", [[2], [1, 2]])
def test_of_one_whole_view_the_cut_ones_say_how_far_the_object_is(column, cut):
    cameras = aimed_aside(network(), CUT, column)
    if 1 in cut:
        box = shown_by(network())[1][1].box
        cameras = aimed_aside(cameras, 1, int(box[0] + 0.4 * (box[2] - box[0])))
    found = shown_by(cameras)[1]
    assert [one.whole for one in found] == [i not in cut for i in range(4)]
    use, whole = np.isin(np.arange(4), cut), np.arange(4) == 0
    centre = centre_on_ray(seen_boxes(cameras, [one.box for one in found], whole, use))
    assert np.linalg.norm(centre - position_at(FRAME)) < 0.25  # the object is a metre long
    ray = cameras[0].K @ (np.linalg.inv(cameras[0].world_from_cam) @ [*centre, 1.0])[:3]
    box = found[0].box
    np.testing.assert_allclose(ray[:2] / ray[2], [(box[0] + box[2]) / 2, (box[1] + box[3]) / 2])
    assert aimed_boxes(seen_boxes(cameras, [one.box for one in found], whole, use), centre)[1].sum() == len(cut)


def test_of_one_whole_view_alone_nothing_is_used():
    cameras = network()
    boxes = [one.box for one in shown_by(cameras)[1]]
    boxes[CUT] = (0.0, 0.0, 4.0, 4.0)  # where no ray through the first box passes
    seen = seen_boxes(cameras, boxes, np.arange(4) == 0, np.arange(4) == CUT)
    assert centre_on_ray(seen) is None
    # Nor of a second camera beside the first: what it cuts off could lie anywhere.
    pose = cameras[0].world_from_cam.copy()
    pose[:3, 3] += 0.02 * pose[:3, 0]
    beside = (cameras[0], replace(cameras[0], world_from_cam=pose), *cameras[2:])
    second = np.arange(4) == 1
    assert centre_on_ray(seen_boxes(beside, boxes, np.arange(4) == 0, second)) is None
    frames, found = shown_by(cameras)
    part = replace(found[CUT], box=boxes[CUT], whole=False)
    silhouettes = [found[0], None, part, None]
    left = observe(frames, silhouettes, cameras, size=SIZE, world_from_rig=np.eye(4), cut_views=True)
    np.testing.assert_array_equal(left.valid, [True, False, False, False])
    assert np.isfinite(np.asarray(left.views.camera.world_from_cam)).all()


def test_known_pixels_lie_in_the_image():
    crop_from_image = np.array([[2.0, 0.0, 10.0], [0.0, 2.0, -6.0], [0.0, 0.0, 1.0]])  # two crop pixels an image pixel
    known = known_pixels(crop_from_image, size=32, image_size=(8, 40))
    centres = np.arange(32) + 0.5
    across, down = (centres - 10) / 2, (centres + 6) / 2
    np.testing.assert_array_equal(known[0], (across >= 1.25) & (across <= 6.75))
    np.testing.assert_array_equal(known[:, 16], (down >= 1.25) & (down <= 38.75))
    assert known.any() and not known[:, 0].any()
    assert known_pixels(np.eye(3), size=8, image_size=(20, 20))[2:, 2:].all()


def test_observations_with_a_cut_view(column):
    narrow = aimed_aside(network(), CUT, column)
    frames, found = shown_by(narrow)
    assert [one.whole for one in found] == [True, True, False, True]
    seen, without = (
        observe(frames, found, narrow, size=SIZE, world_from_rig=np.eye(4), cut_views=use) for use in (True, False)
    )
    np.testing.assert_array_equal(seen.cut, np.arange(4) == CUT)
    assert seen.valid.all() and without.views.known is None and not without.cut.any()
    np.testing.assert_array_equal(without.valid, seen.whole)
    for name in ("rgb", "mask"):  # the others' crops, and where they stand, are the same bits
        np.testing.assert_array_equal(
            np.delete(getattr(seen.views, name), CUT, 0), np.delete(getattr(without.views, name), CUT, 0)
        )
    np.testing.assert_array_equal(seen.rig_from_crop, without.rig_from_crop)
    known = np.asarray(seen.views.known)
    assert known[[0, 1, 3]].all() and 0.2 < known[CUT].mean() < 0.8
    # The cut crop's camera sees a point where the image shows it, and its mask is the object's where it is known.
    pose = np.asarray(seen.views.camera.world_from_cam[CUT], np.float64)
    inside = np.asarray(seen.views.camera.K[CUT]) @ (np.linalg.inv(pose) @ [0.05, 0.02, -0.04, 1.0])[:3]
    image = project_points(seen.rig_from_crop[:3, 3] + [0.05, 0.02, -0.04], narrow[CUT])
    pixel = seen.crop_from_image[CUT] @ [*image, 1.0]
    np.testing.assert_allclose(inside[:2] / inside[2], pixel[:2] / pixel[2], atol=1e-3)
    mask = np.asarray(seen.views.mask[CUT])
    assert (mask[known[CUT]] > 0.5).any() and (mask[known[CUT]] < 0.5).any()
