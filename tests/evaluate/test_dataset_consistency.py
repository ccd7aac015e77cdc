"""Boxes, residuals and their causes, coverage, and reading, on views whose figures are known."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from aerojax.evaluate.dataset_qa.boxes import NOWHERE, box_overlaps, clip_boxes, subpixel_box
from aerojax.evaluate.dataset_qa.consistency import box_causes, consistency, residual_causes, smoothness, spread
from aerojax.evaluate.dataset_qa.coverage import (
    area_histogram,
    distance_edges,
    distance_histogram,
    heat_map,
    visibility_curve,
)
from aerojax.evaluate.dataset_qa.observations import Observations, joined


def rectangle(x0: float, y0: float, x1: float, y1: float, rows: int = 12, columns: int = 16) -> np.ndarray:
    """Exact coverage of an axis-aligned rectangle."""

    def shares(low: float, high: float, count: int) -> np.ndarray:
        cells = np.arange(count)
        return (np.minimum(cells + 1, high) - np.maximum(cells, low)).clip(0.0, 1.0)

    return np.outer(shares(y0, y1, rows), shares(x0, x1, columns))


@pytest.mark.parametrize("box", [(3.25, 2.5, 9.75, 8.0), (0.0, 0.0, 16.0, 12.0), (4.9, 3.4, 12.1, 3.7)])
def test_subpixel_box_of_a_rectangle_is_exact(box):
    found = subpixel_box(rectangle(*box))
    np.testing.assert_allclose(found[[0, 2]], [box[0], box[2]], atol=1e-9)
    if box[3] - box[1] > 1:
        np.testing.assert_allclose(found[[1, 3]], [box[1], box[3]], atol=1e-9)
    else:  # within one row nothing says where in it the sliver lies
        np.testing.assert_allclose(found[[1, 3]], [3.0, 4.0])


def test_subpixel_box_of_nothing():
    assert np.isnan(subpixel_box(np.zeros((3, 3)))).all()


def test_overlaps_by_hand():
    one = np.array([[0.0, 0, 2, 2], [0, 0, 2, 2], [0, 0, 1, 1], list(NOWHERE)])
    other = np.array([[1.0, 1, 3, 3], [0, 0, 2, 2], [5, 5, 6, 6], [0, 0, 1, 1]])
    np.testing.assert_allclose(box_overlaps(one, other), [1 / 7, 1.0, 0.0, np.nan])
    clipped = clip_boxes(np.array([[-5.0, 2.0, 700.0, 500.0]]), np.array([[640.0, 360.0]]))
    np.testing.assert_allclose(clipped, [[0.0, 2.0, 640.0, 360.0]])


def view(**changes: object) -> Observations:
    """One view of a bird of 100×50 pixels at 10 m, in which everything agrees; `changes` are values of columns."""
    box = (100.0, 100.0, 200.0, 150.0)
    agreed: dict[str, object] = {
        **{"sequence": 0, "tracked": 0, "label": 0, "frame": 0, "camera": 0, "size": (640.0, 360.0)},
        **{"distance": 10.0, "focal": 1000.0, "truncated": False, "visibility": 1.0, "area": 3000.0},
        **{"covered": 3000.0, "projected_box": box, "mask_box": box, "covered_box": box, "centroid": (150.0, 125.0)},
        **{"depth_centroid": (150.0, 125.0), "surface_pixel": (150.0, 125.0), "origin_pixel": (153.0, 129.0)},
        "position": (0.0, 0.0, 0.0),
    }
    return Observations(**{name: np.array([value]) for name, value in (agreed | changes).items()})  # type: ignore[arg-type]


SMALL = (100.3, 100.3, 109.7, 103.7)


@pytest.mark.parametrize(
    ("changes", "cause"),
    [
        ({}, ""),
        ({"projected_box": SMALL, "mask_box": (100.0, 100.0, 110.0, 104.0)}, "pixel grid"),
        (
            {"projected_box": SMALL, "mask_box": (103.0, 101.0, 107.0, 103.0), "covered_box": SMALL},
            "mask threshold",
        ),
        (
            {"projected_box": SMALL, "mask_box": (103.0, 101.0, 107.0, 103.0), "covered_box": (103, 101, 107, 103.0)},
            "between samples",
        ),
        ({"mask_box": (100.0, 100.0, 150.0, 150.0), "visibility": 0.5}, "occluded"),
        ({"mask_box": (100.0, 100.0, 150.0, 150.0), "covered_box": (100.0, 100.0, 150.0, 150.0)}, "unexplained"),
        ({"mask_box": (100.0, 100.0, 230.0, 150.0)}, "unexplained"),
    ],
)
def test_causes_of_boxes(changes, cause):
    assert box_causes(view(**changes)).tolist() == [cause]


NAN = (np.nan, np.nan)


@pytest.mark.parametrize(
    ("changes", "cause"),
    [
        ({}, ""),
        ({"centroid": (152.0, 125.0)}, "perspective"),  # the depth image confirms it
        # Without it the bound speaks: 0.5·111.8·0.5/10 = 2.8 pixels.
        ({"centroid": (152.0, 125.0), "depth_centroid": NAN}, "perspective"),
        ({"centroid": (153.0, 125.0), "depth_centroid": NAN}, "unexplained"),
        ({"centroid": (153.0, 125.0), "depth_centroid": (153.0, 125.0)}, "unexplained"),
        ({"centroid": (153.0, 125.0), "depth_centroid": NAN, "visibility": 0.4}, "occluded"),
        ({"centroid": (153.0, 125.0), "depth_centroid": NAN, "covered": 9.0, "area": 8.0}, "few pixels"),
    ],
)
def test_causes_of_residuals(changes, cause):
    assert residual_causes(view(**changes)).tolist() == [cause]


def test_table_of_a_rig():
    empty = {"area": 0.0, "covered": 0.0, "mask_box": NOWHERE, "covered_box": NOWHERE, "centroid": NAN}
    cut = {"truncated": True, "projected_box": (-50.0, 100.0, 50.0, 150.0), "mask_box": (0.0, 100.0, 50.0, 150.0)}
    views = joined(
        [
            view(),
            view(
                frame=1,
                position=(1.0, 0.0, 0.0),
                mask_box=(100.0, 100.0, 150.0, 150.0),
                covered_box=(100, 100, 150.0, 150),
            ),
            view(frame=2, position=(4.0, 0.0, 0.0), **cut),
            view(frame=3, position=(5.0, 0.0, 0.0), **empty),
            view(frame=4, position=(6.0, 0.0, 0.0), **{**empty, "covered": 0.3}),
            view(frame=5, position=(7.0, 0.0, 0.0), **{**empty, "visibility": 0.0}),
        ]
    )
    row = consistency("sim1", views)
    assert (row.views, row.truncated, row.faint, row.missed) == (3, 1, 1, 1)
    assert row.iou.count == 2 and row.iou.median == pytest.approx(0.75)
    assert row.iou_truncated.median == 1.0 and row.iou_grid.median == 1.0
    assert row.origin.median == 5.0 and row.origin_body.median == pytest.approx(0.05)
    assert [(c.name, c.views) for c in row.box_causes if c.views] == [("unexplained", 1)]
    assert row.box_causes[-1].share == 0.5
    assert row.smoothness.median == pytest.approx(3.0 / (7.0 / 5.0))
    assert [(s.low, s.views) for s in row.by_side] == [(32.0, 2)]


def test_paths_are_told_apart_and_rest_is_counted():
    steps = [view(frame=f, camera=c, position=(float(f), 0, 0.0)) for f in range(4) for c in range(2)]
    rest = [view(frame=f, tracked=1) for f in range(4)]
    jump = [view(frame=f, sequence=1, position=(x, 0.0, 0.0)) for f, x in enumerate((0.0, 1.0, 2.0, 12.0))]
    values, resting = smoothness(joined(steps + rest + jump))
    np.testing.assert_allclose(values, [1.0, 10.0 / 4.0])
    assert resting == 1


def test_spread_ignores_what_is_not_there():
    found = spread(np.array([1.0, np.nan, 3.0]))
    assert (found.count, found.median) == (2, 2.0)
    assert spread(np.array([np.nan])).count == 0


def test_areas_and_distances_fall_into_their_bins():
    views = joined(
        [view(area=a, distance=d, label=k) for a, d, k in ((144.0, 2.0, 0), (145.0, 280.0, 0), (2001.0, 5.0, 3))]
        + [view(area=0.0)]
    )
    areas, distances = area_histogram(views), distance_histogram(views)
    assert areas.sum() == distances.sum() == 3
    assert areas[0].tolist() == [1, 1, 0, 0, 0, 0, 0, 0] and areas[3, 4] == 1
    assert distances[0, 0] == distances[0, 9] == distances[3, 1] == 1
    np.testing.assert_allclose(distance_edges()[1:3], [np.sqrt(8.0), np.sqrt(32.0)])


def test_visibility_counts_cameras_of_a_moment():
    areas = [(0, 5.0, 5.0, 0.0), (1, 5.0, 0.0, 0.0)]
    views = joined([view(frame=f, camera=c, area=a) for f, *row in areas for c, a in enumerate(row)])
    np.testing.assert_allclose(visibility_curve(views), [1.0, 0.5, 0.0])


def test_heat_map_counts_centroids_in_their_cells():
    views = joined([view(centroid=(5.0, 5.0)), view(centroid=(635.0, 355.0)), view(centroid=(636.0, 356.0))])
    heat = heat_map(views)
    assert heat.shape == (36, 64)
    assert heat[0, 0] == pytest.approx(np.log(2)) and heat[-1, -1] == pytest.approx(np.log(3))
    assert np.count_nonzero(heat) == 2


def test_rows_are_chosen_in_every_column():
    views = joined([view(), view(frame=1)])
    one = views.where(np.array([False, True]))
    assert {len(getattr(one, f.name)) for f in dataclasses.fields(one)} == {1} and one.frame[0] == 1
