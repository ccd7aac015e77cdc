"""Curves place values where they belong."""

from __future__ import annotations

import re

import numpy as np
import pytest

from aerojax.view.svg import curves, height_curve, nice_ticks, top_view


@pytest.mark.parametrize(
    ("low", "high", "ticks"),
    [
        (0.0, 1.0, [0, 0.2, 0.4, 0.6, 0.8, 1]),
        (-3.0, 12.0, [-2, 0, 2, 4, 6, 8, 10, 12]),
        (0.0, 23.0, [0, 5, 10, 15, 20]),
        (2.0, 2.0, [2]),
    ],
)
def test_ticks_are_round(low, high, ticks):
    assert nice_ticks(low, high) == pytest.approx(ticks)


def polyline(svg: str) -> np.ndarray:
    return np.array([[float(v) for v in p.split(",")] for p in re.search(r'points="([^"]*)"', svg)[1].split(" ")])


def test_top_view_has_one_scale_and_points_up():
    places = polyline(top_view(np.array([[0.0, 0, 5], [4.0, 0, 5], [4.0, 3, 5]])))
    right, up = places[1] - places[0], places[2] - places[1]
    assert right[0] > 0 and up[1] < 0
    assert right[0] / 4 == pytest.approx(-up[1] / 3, abs=0.1)
    assert right[1] == up[0] == 0


def test_curves_place_values_and_cursors():
    svg = curves("p", [2, 4, 6], {"a": [0.0, 1.0, 0.5], "b": [0.0, float("nan"), 1.0]}, "p")
    places = polyline(svg)
    assert places[1, 1] < places[2, 1] < places[0, 1]
    assert places[2, 1] == pytest.approx((places[0, 1] + places[1, 1]) / 2, abs=0.1)
    cursor = [float(p.split(",")[0]) for p in re.search(r'data-at="([^"]*)"', svg)[1].split(" ")]
    assert cursor == places[:, 0].tolist()
    assert len(re.search(r's1" points="([^"]*)"', svg)[1].split(" ")) == 2
    assert len(re.search(r'data-at="([^"]*)"', height_curve([0, 1], [float("nan"), 3.0]))[1].split(" ")) == 2
