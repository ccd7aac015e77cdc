"""Of several parts of a mask, the one that the other cameras see too is the object."""

from __future__ import annotations

import numpy as np
import pytest
from support.networks import HEIGHT, WIDTH, mask_of, network

from aerojax.core.types import FrameSet, Silhouette
from aerojax.segment.silhouettes import silhouette_of
from aerojax.track.consensus import agreed
from aerojax.track.parts import parts_of
from aerojax.track.single import SingleConfig

PLACE = np.array([0.3, -0.2, 0.1])


def seen(cameras, *, places=(PLACE,), specks=(), speck_in=None) -> list[Silhouette]:
    """Silhouettes of ellipsoids at `places`, with single pixels at `specks` (column, row) in some cameras or all."""
    found = []
    for index, camera in enumerate(cameras):
        coverage = np.zeros((HEIGHT, WIDTH), np.float32)
        for place in places:
            coverage[mask_of(camera, place)] = 1
        if speck_in is None or index in speck_in:
            for x, y in specks:
                coverage[y, x] = 1
        one = silhouette_of(index, 1, coverage)
        assert one is not None
        found.append(one)
    return found


def test_silhouettes_of_one_part_stay_the_same_objects():
    cameras = network(4)
    before = seen(cameras)
    after = agreed(before, cameras)
    assert all(one is other for one, other in zip(before, after, strict=True))


@pytest.mark.parametrize("specks", [((0, 0),), ((4, 4),), ((0, 0), (159, 119), (2, 110)), ((10, 3), (11, 3), (12, 3))])
@pytest.mark.parametrize("speck_in", [None, (2,)], ids=["in all", "in one"])
@pytest.mark.parametrize("count", [3, 4, 6])
def test_stray_pixels_change_nothing(count, speck_in, specks):
    cameras = network(count)
    clean = seen(cameras)
    for one, wanted in zip(agreed(seen(cameras, specks=specks, speck_in=speck_in), cameras), clean, strict=True):
        assert one.box == wanted.box and one.whole
        np.testing.assert_array_equal(one.coverage, wanted.coverage)


def test_the_position_is_that_without_stray_pixels():
    cameras = network(4)
    tracker = SingleConfig().build()
    nothing = FrameSet(0, 0.0, (None,) * 4, (None,) * 4)
    ((track,), _) = tracker.step(nothing, seen(cameras, specks=((0, 0), (30, 2))), tracker.initial(cameras))
    ((clean,), _) = tracker.step(nothing, seen(cameras), tracker.initial(cameras))
    np.testing.assert_array_equal(track.position, clean.position)
    np.testing.assert_allclose(track.position, PLACE, atol=0.05)


def test_a_larger_blob_that_no_other_camera_sees_is_left_out():
    cameras = network(4)
    before = seen(cameras)
    disturbed = before[1].coverage.copy()
    disturbed[70:118, 2:40] = 1  # more pixels than the object has
    one = silhouette_of(1, 1, disturbed)
    assert one is not None and parts_of(one)[0].area > 1.5 * (before[1].coverage > 0.5).sum()
    after = agreed([before[0], one, *before[2:]], cameras)
    np.testing.assert_array_equal(after[1].coverage, before[1].coverage)


def test_of_two_objects_the_larger_one_is_kept_by_all():
    cameras = network(5)
    other = np.array([-0.9, 0.9, 0.5])
    after = agreed(seen(cameras, places=(PLACE, other)), cameras)
    truth = [[mask_of(camera, place) for place in (PLACE, other)] for camera in cameras]
    kept = {
        place
        for one, masks in zip(after, truth, strict=True)
        for place in (0, 1)
        if np.count_nonzero((one.coverage > 0.5) & masks[place]) > 0.9 * np.count_nonzero(masks[place])
    }
    assert kept in ({0}, {1})


def test_a_camera_that_shows_a_speck_alone_is_left_out():
    cameras = network(5)
    before = seen(cameras)
    coverage = np.zeros((HEIGHT, WIDTH), np.float32)
    coverage[10:12, 20:23] = 1
    speck = silhouette_of(2, 1, coverage)
    assert speck is not None
    after = agreed([*before[:2], speck, *before[3:]], cameras)
    assert [one.camera for one in after] == [0, 1, 3, 4]


def test_a_single_part_that_disagrees_is_kept_for_the_figures_to_show():
    cameras = network(4)
    before, moved = seen(cameras), seen(cameras, places=(PLACE + np.array([0.8, 0.8, 0.6]),))
    mixed = [before[0], moved[1], *before[2:]]
    assert agreed(mixed, cameras) == mixed


def test_gaps_within_an_object_are_no_parting():
    coverage = np.zeros((HEIGHT, WIDTH), np.float32)
    coverage[50:60, 40:80], coverage[52:54, 88:95], coverage[56, 33] = 1, 1, 1
    one = silhouette_of(0, 1, coverage)
    assert one is not None
    (part,) = parts_of(one)
    assert part.box == one.box and part.area == (coverage > 0).sum()
    coverage[5, 120] = 1
    far = silhouette_of(0, 1, coverage)
    assert far is not None
    parts = parts_of(far)
    assert [p.area for p in parts] == [part.area, 1] and parts[0].box == one.box


def test_soft_rims_stay_with_their_part():
    coverage = np.zeros((HEIGHT, WIDTH), np.float32)
    coverage[49:61, 39:81], coverage[50:60, 40:80], coverage[0, 0] = 0.3, 1, 1
    one = silhouette_of(0, 1, coverage)
    assert one is not None and not one.whole
    kept = parts_of(one)[0].silhouette()
    coverage[0, 0] = 0
    assert kept.whole
    np.testing.assert_array_equal(kept.coverage, coverage)
