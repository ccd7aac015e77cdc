"""Residuals and their causes on views whose figures are known."""

from __future__ import annotations

import numpy as np
import pytest
from support.observed_views import view

from aerojax.evaluate.dataset_qa.boxes import NOWHERE
from aerojax.evaluate.dataset_qa.consistency import box_causes, consistency, residual_causes, smoothness, spread
from aerojax.evaluate.dataset_qa.observations import joined

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
