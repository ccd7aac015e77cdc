"""Histograms, visibility and heat maps of views whose places are known."""

from __future__ import annotations

import numpy as np
import pytest
from support.observed_views import view

from aerojax.evaluate.dataset_qa.coverage import (
    area_histogram,
    distance_edges,
    distance_histogram,
    heat_map,
    visibility_curve,
)
from aerojax.evaluate.dataset_qa.observations import joined


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
