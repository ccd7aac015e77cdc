"""The parts of `voxel_vote`: registration, backgrounds, the search of voxels, masks."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from support.networks import mask_of, network, position_at

from aerojax.geometry.cameras import look_at
from aerojax.segment.silhouettes import silhouette_of
from aerojax.segment.voxel_vote.agreement import uncontradicted
from aerojax.segment.voxel_vote.background import (
    EVERY,
    BackgroundConfig,
    after,
    difference_of,
    learnt,
)
from aerojax.segment.voxel_vote.cluster import Region, candidates
from aerojax.segment.voxel_vote.continued import continue_surroundings
from aerojax.segment.voxel_vote.cue import CueConfig, common_gain, motion_weight, unlike_background
from aerojax.segment.voxel_vote.lingering import outline_of, without_lingering
from aerojax.segment.voxel_vote.registration import STILL, offset_of
from aerojax.segment.voxel_vote.silhouette import MaskConfig, coverage_of, without
from aerojax.segment.voxel_vote.sky import open_sky
from aerojax.segment.voxel_vote.volume import monitored_volume
from aerojax.segment.voxel_vote.vote import VoteConfig, needed_views, vote

CONFIG = BackgroundConfig()


def mottled(shape=(120, 160), seed=0, scale=2.0):
    found = cv2.GaussianBlur(np.random.default_rng(seed).normal(size=shape).astype(np.float32), (0, 0), scale)
    return 0.5 + 0.1 * found / found.std()


def coloured(grey):
    return np.repeat(grey[..., None], 3, axis=-1).astype(np.float32)


def bytes_of(image):
    return np.round(255 * image).astype(np.uint8)


@pytest.mark.parametrize("offset", [(0.4, -0.3), (2.5, 1.25), (-5.0, 3.0)])
def test_a_displacement_is_found_to_a_twentieth_of_a_pixel_whatever_moves_and_shines(offset):
    still = mottled()
    moved = np.array([[1.0, 0.0, offset[0]], [0.0, 1.0, offset[1]]])
    seen = cv2.warpAffine(still, moved, still.shape[::-1], flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)
    seen[30:50, 40:70] = 1.0
    np.testing.assert_allclose(offset_of(1.05 * seen, still), offset, atol=0.05)


def test_a_sky_says_nothing_of_displacement_nor_does_what_flies_in_it():
    sky = np.repeat(np.linspace(0.6, 0.8, 120, dtype=np.float32)[:, None], 160, axis=1)
    before, now = sky.copy(), sky.copy()
    before[40:50, 40:60], now[40:50, 46:66] = 0.2, 0.2
    noise = np.random.default_rng(0).normal(scale=0.004, size=sky.shape).astype(np.float32)
    assert offset_of(now + noise, before) == STILL == offset_of(sky + noise, sky)


@pytest.mark.parametrize("count", [1, 2, 5, 8, 15])
def test_a_background_is_the_median_of_its_images(count):
    images = list(np.random.default_rng(count).integers(0, 256, (count, 12, 16, 3)).astype(np.uint8))
    median = np.median(np.stack(images), axis=0).astype(np.float32) / 255
    np.testing.assert_allclose(learnt(images, CONFIG).mean, median, atol=1e-6)


def test_brighter_light_is_no_difference_and_an_object_is():
    still = coloured(mottled())
    known = learnt([bytes_of(still)] * 5, CONFIG)
    image = 1.15 * still
    image[50:60, 70:90] = 0.1
    seen = difference_of(image, known, CONFIG)
    weight = motion_weight(image, seen, CueConfig())
    assert weight[52:58, 72:88].min() == 1.0
    weight[47:63, 67:93] = 0
    assert weight.max() == 0


def test_what_stays_becomes_background_but_for_objects():
    still = coloured(mottled())
    known = learnt([bytes_of(still)] * 5, CONFIG)
    image = still.copy()
    image[10:20, 10:20] = image[60:70, 60:70] = 0.95
    objects = np.zeros(still.shape[:2], bool)
    objects[60:70, 60:70] = True
    for _ in range(0, 200, EVERY):
        known = after(image, difference_of(image, known, CONFIG), known, objects, CONFIG)
    assert np.abs(known.mean - image)[10:20, 10:20].max() < 0.1
    np.testing.assert_array_equal(known.mean[60:70, 60:70], bytes_of(still)[60:70, 60:70] * np.float32(1 / 255))


def test_a_shadow_keeps_the_texture_and_an_object_has_none_of_it():
    still = coloured(mottled(scale=1.0))
    known = learnt([bytes_of(still)] * 5, CONFIG)
    place = Region((40, 40), np.ones((12, 12), bool))
    for cover, light in ((lambda patch: 0.5 * patch, True), (lambda patch: np.full_like(patch, 0.15), False)):
        image = still.copy()
        image[place.window] = cover(image[place.window])
        seen = difference_of(image, known, CONFIG)
        unlike = unlike_background(image, seen, place, CueConfig())
        assert unlike is not None and (unlike < 0.3) == light
    plain = learnt([np.full((120, 160, 3), 128, np.uint8)] * 5, CONFIG)
    seen = difference_of(image, plain, CONFIG)
    assert unlike_background(image, seen, place, CueConfig()) is None


def test_a_shadow_without_texture_is_one_gain_and_a_shaded_object_is_not():
    plain = np.full((120, 160, 3), (90, 110, 60), np.uint8)
    known, place = learnt([plain] * 5, CONFIG), Region((40, 40), np.ones((12, 12), bool))
    shading = np.linspace(0.3, 0.6, 12, dtype=np.float32)[:, None, None]
    for cover, gain in ((np.float32([0.6, 0.65, 0.8]), [0.6, 0.65, 0.8]), (shading, None), (np.float32(1.3), None)):
        image = plain.astype(np.float32) / 255
        image[place.window] *= cover
        found = common_gain(image, difference_of(image, known, CONFIG), place)
        assert (found is None) == (gain is None)
        if found is not None:
            np.testing.assert_allclose(found, gain, atol=0.01)


def test_how_many_cameras_must_agree():
    assert needed_views(np.arange(2, 11), VoteConfig()).tolist() == [2, 3, 3, 4, 5, 5, 6, 7, 7]
    assert needed_views(np.arange(2, 5), VoteConfig(views=4)).tolist() == [4, 4, 4]


@pytest.mark.parametrize("count", [2, 3, 5])
def test_voxels_hold_the_object_and_little_else(count):
    cameras, centre = network(count), position_at(7)
    weights = [mask_of(camera, centre).astype(np.float32) for camera in cameras]
    volume = monitored_volume(cameras, reach=20.0)
    voxels = vote(volume, weights, VoteConfig())
    (found,) = candidates(voxels, cameras, weights, VoteConfig())
    assert found.votes == found.watched == count
    np.testing.assert_allclose(found.centre, centre, atol=0.08)
    for weight, region in zip(weights, found.regions, strict=True):
        assert region is not None and weight[region.window][region.inside].sum() == weight.sum()
        assert region.inside.sum() < 5 * weight.sum()


@pytest.mark.parametrize("turn", [np.eye(4), np.diag([1.0, -1.0, -1.0, 1.0])])
@pytest.mark.parametrize("height", [0.0, 40.0])
def test_below_is_lower_than_cameras_of_a_line_wherever_they_look(turn, height):
    places = [np.array([20.0 * i, -60.0, 8.0]) for i in range(4)]
    poses = [turn @ look_at(place, np.array([30.0, 0.0, 8.0 + height])) for place in places]
    cameras = tuple(replace(one, world_from_cam=pose) for one, pose in zip(network(4), poses, strict=True))
    volume = monitored_volume(cameras, reach=20.0)
    heights = {z: volume.is_below(turn[:3, :3] @ np.array([30.0, 0.0, z])) for z in (0.0, 7.0, 9.0, 8.0 + height / 2)}
    assert heights == {z: z < 8 for z in heights}


@pytest.mark.parametrize("turn", [np.eye(4), np.diag([1.0, -1.0, -1.0, 1.0])])
def test_below_is_lower_than_all_cameras_however_the_world_is_turned(turn):
    cameras = tuple(replace(camera, world_from_cam=turn @ camera.world_from_cam) for camera in network(4))
    volume, poses = monitored_volume(cameras, reach=20.0), np.stack([camera.world_from_cam for camera in cameras])
    middle, down = poses[:, :3, 3].mean(axis=0), poses[:, :3, 1].mean(axis=0)
    assert volume.is_below(middle + 50 * down)
    assert not volume.is_below(middle) and not volume.is_below(middle - 50 * down)


def test_nothing_is_below_cameras_that_all_look_the_same_way():
    places = [np.array([20.0 * i, 0.0, 0.0]) for i in range(4)]
    poses = [look_at(place, place + np.array([0.0, 60.0, 20.0])) for place in places]
    cameras = tuple(replace(one, world_from_cam=pose) for one, pose in zip(network(4), poses, strict=True))
    volume = monitored_volume(cameras, reach=20.0)
    assert not volume.is_below(np.array([0.0, 100.0, 1.0])) and not volume.is_below(np.array([0.0, 100.0, -99.0]))


def test_what_one_camera_sees_is_no_voxel_nor_is_what_none_sees():
    cameras = network(4)
    volume = monitored_volume(cameras, reach=20.0)
    blank = np.zeros((cameras[0].height, cameras[0].width), np.float32)
    alone = [mask_of(cameras[0], position_at(7)).astype(np.float32), blank, blank, blank]
    for weights in (alone, [blank] * 4, [None] * 4, [np.ones_like(blank), None, None, None]):
        assert len(vote(volume, weights, VoteConfig()).half) == 0


@pytest.mark.parametrize(("sky", "found"), [("voters", True), ("all", False), ("others", False), ("none", False)])
def test_cameras_that_see_no_sky_there_may_be_hidden_from_it(sky, found):
    cameras, centre = network(5), position_at(7)
    volume = monitored_volume(cameras, reach=20.0)
    masks = [mask_of(camera, centre).astype(np.float32) for camera in cameras]
    weights = [mask if index < 3 else np.zeros_like(mask) for index, mask in enumerate(masks)]
    open_to = {"voters": range(3), "others": range(3, 5), "all": range(5), "none": ()}[sky]
    skies = [np.full((cameras[0].height // 4, cameras[0].width // 4), index in open_to) for index in range(5)]
    voxels = vote(volume, weights, VoteConfig(), skies)
    (candidate,) = candidates(voxels, cameras, weights, VoteConfig()) or [None]
    assert (candidate is not None) == found
    if candidate is not None:
        assert candidate.votes == candidate.watched == 3 and candidate.clear
        np.testing.assert_allclose(candidate.centre, centre, atol=0.08)
    assert len(vote(volume, weights, VoteConfig()).half) == 0


def test_sky_is_what_is_brighter_than_all_trees_and_everything_where_there_is_no_contrast():
    sky, trees = np.full((6, 8), 0.7, np.float32), np.full((6, 8), 0.2, np.float32)
    half = np.concatenate([sky[:3], trees[:3]])
    for grey, is_sky in zip((sky, None, trees, half), open_sky((sky, None, trees, half)), strict=True):
        assert (is_sky is None) if grey is None else (is_sky == (grey > 0.5)).all()
    for greys in ((sky, sky - np.float32(0.1)), (trees,)):
        assert all(one is not None and one.all() for one in open_sky(greys))
    assert open_sky((None,)) == (None,)


@pytest.mark.parametrize(
    ("clear", "shift", "kept"),
    [((0, 1, 2), 0, [0, 1, 2, 3, 4]), ((0, 1, 2), 25, [0, 1, 2, 3]), ((0, 1), 25, [0, 1, 2, 3, 4])],
)
def test_a_mask_before_trees_counts_if_the_hull_of_those_before_the_sky_agrees(clear, shift, kept):
    cameras, centre = network(5), position_at(7)
    coverages = [mask_of(camera, centre).astype(np.float32) for camera in cameras]
    found = candidates(
        vote(monitored_volume(cameras, reach=20.0), coverages, VoteConfig()), cameras, coverages, VoteConfig()
    )
    coverages[4] = np.roll(coverages[4], shift, axis=1)
    masks = [silhouette_of(index, 1, coverage) for index, coverage in enumerate(coverages)]
    left = uncontradicted(found[0], masks, [index in clear for index in range(5)], cameras)
    assert [one.camera for one in left] == kept


@pytest.mark.parametrize(("leaves", "kept"), [(False, [0, 1, 2, 3, 4]), (True, [0, 1, 2])])
def test_the_hull_of_a_thin_object_is_wider_than_its_masks_and_contradicts_leaves_alone(leaves, kept):
    cameras, centre = network(5), position_at(7)
    wing = np.array([0.8, 0.04, 0.04])
    coverages = [mask_of(camera, centre, wing).astype(np.float32) for camera in cameras]
    (found,) = candidates(
        vote(monitored_volume(cameras, reach=20.0), coverages, VoteConfig()), cameras, coverages, VoteConfig()
    )
    if leaves:
        waving = np.random.default_rng(0).random(coverages[0].shape) < 0.3
        for index in (3, 4):
            region = found.regions[index]
            assert region is not None
            coverages[index][region.window] = waving[region.window] & region.inside
    masks = [silhouette_of(index, 1, coverage) for index, coverage in enumerate(coverages)]
    left = uncontradicted(found, masks, [index < 3 for index in range(5)], cameras)
    assert [one.camera for one in left] == kept


def test_crossing_rays_of_two_objects_are_no_third():
    cameras = network(4)
    places = [np.array([0.9, 0.3, 0.0]), np.array([-0.7, -0.5, 0.1])]
    masks = [[mask_of(camera, place) for place in places] for camera in cameras]
    weights = [np.logical_or(*pair).astype(np.float32) for pair in masks]
    voxels = vote(monitored_volume(cameras, reach=20.0), weights, VoteConfig(views=2))
    found = candidates(voxels, cameras, weights, VoteConfig(views=2))
    nearest = [min(np.linalg.norm(one.centre - place) for place in places) for one in found]
    assert len(found) == 2 and max(nearest) < 0.1


def test_coverage_is_soft_at_the_rim_and_full_inside():
    still = np.full((120, 160, 3), 0.7, np.float32)
    share = np.zeros((120, 160), np.float32)
    share[20:40, 30:50] = 1.0
    share[20:40, 29] = share[20:40, 50] = 0.2
    image = still + share[..., None] * (np.float32(0.1) - still)
    seen = difference_of(image, learnt([bytes_of(still)] * 5, CONFIG), CONFIG)
    region = Region((25, 15), np.ones((30, 30), bool))
    coverage = coverage_of(region, seen, (share > 0.5).astype(np.float32), MaskConfig(half=0.5))
    np.testing.assert_allclose(coverage, share, atol=0.05)
    hidden = without(region, [Region((0, 0), np.ones((30, 160), bool))])
    assert not hidden.inside[:15].any() and hidden.inside[15:].all()


def test_what_an_object_hides_in_most_frames_is_learnt_from_the_others_and_continued():
    still = coloured(mottled(scale=8.0))
    region = Region((60, 50), np.ones((12, 20), bool))
    covered = still.copy()
    covered[region.window] = 0.0
    known = learnt([bytes_of(covered)] * 5, CONFIG)
    outline, elsewhere = outline_of(region), outline_of(Region((8, 8), np.ones((4, 4), bool)))
    assert outline is not None and elsewhere is not None
    images = [bytes_of(image) for image in [covered] * 4 + [still] * 2]
    outlines = {0: [outline], 2: [outline], 4: [elsewhere], 5: [elsewhere]}  # frames 1 and 3 were not looked at
    relearnt = without_lingering(known, images, outlines)
    np.testing.assert_allclose(relearnt.mean, still, atol=0.005)
    assert without_lingering(known, images, {}) is known


def test_what_is_never_seen_is_continued_where_it_changes_and_doubted_by_the_surroundings_texture():
    region, variances = Region((60, 50), np.ones((12, 20), bool)), []
    outline = outline_of(region)
    assert outline is not None
    plain, smooth, rough = np.full((120, 160, 3), 0.6, np.float32), mottled(scale=8.0), mottled(scale=2.0)
    for still, most in ((plain, 0.01), (coloured(smooth), 0.05), (coloured(rough), 0.3)):
        shown = [still.copy() for _ in range(6)]
        for number, image in enumerate(shown):
            image[region.window] = 0.1 * (number % 2)
        images = [bytes_of(image) for image in shown]
        known = learnt(images[:1], CONFIG)
        relearnt = without_lingering(known, images, {frame: [outline] for frame in range(6)})
        np.testing.assert_allclose(relearnt.mean[:40], known.mean[:40])
        variances.append(np.median(relearnt.variance[region.window]))
        assert np.abs(relearnt.mean - still)[region.window].max() < most
        # What is the same in all frames may as well be there, and is left alone.
        assert without_lingering(known, images[:1] * 6, {frame: [outline] for frame in range(6)}) is known
    assert variances[2] > 2 * max(variances[:2])


@pytest.mark.parametrize("angle", [0, 20, 65, 90, 140])
def test_straight_edges_go_on_through_what_is_never_seen(angle):
    rows, columns = np.mgrid[:80, :100]
    across = (rows - 40) * np.cos(np.radians(angle)) - (columns - 50) * np.sin(np.radians(angle))
    still = coloured(np.clip(0.5 + 0.2 * across, 0.3, 0.7))
    gap = ((rows - 40) / 12) ** 2 + ((columns - 50) / 20) ** 2 < 1
    mean, variance = np.where(gap[..., None], np.float32(0), still), np.zeros(gap.shape, np.float32)
    continue_surroundings(mean, variance, gap.astype(np.uint8))
    off = np.abs(mean - still).max(axis=-1)
    assert np.median(off[gap]) < 0.01 and np.mean(off[gap] > 0.1) < 0.1 and off[~gap].max() == 0
    assert (variance[gap] > 0).all() and not variance[~gap].any()


def test_a_network_whose_cameras_look_apart_monitors_nothing():
    cameras = network(3)
    away = np.diag([1.0, -1.0, -1.0, 1.0])
    turned = tuple(replace(camera, world_from_cam=camera.world_from_cam @ away) for camera in cameras)
    volume = monitored_volume(turned, reach=20.0)
    weights = [np.ones((c.height, c.width), np.float32) for c in turned]
    assert len(volume.centres) == 0 and len(vote(volume, weights, VoteConfig()).half) == 0
