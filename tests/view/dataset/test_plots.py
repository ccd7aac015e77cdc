"""Plots of data sets are well-formed files."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree

import cv2
import numpy as np
import pytest

from aerojax.view.dataset.plots import Curve, Labels, bar_plot, curve_plot, heat_png, standalone


def test_plots_are_well_formed_files():
    curve = Curve(np.arange(5.0), np.array([0.0, 1, 2, 1, 0]), np.full(5, 0.3))
    labels = Labels('a < "b"', "x & y", "z")
    for plot in (
        curve_plot(labels, {"bird": curve}, marks=[2.0], colour=3),
        bar_plot(labels, ["≤ 1", "larger"], {"bird": [0.25, 0.75], "drone": [0.0, 1.0]}),
        curve_plot(labels, {"empty": Curve(np.zeros(1), np.zeros(1))}),
    ):
        root = ElementTree.fromstring(standalone(plot))
        assert root.attrib["aria-label"] == 'a < "b"'
    bars = bar_plot(labels, ["1", "2"], {"bird": [0.5, 1.0]})
    heights = [float(rect.attrib["height"]) for rect in ElementTree.fromstring(bars).iter("rect")][:2]
    assert heights[1] == pytest.approx(2 * heights[0], abs=0.11)


def test_heat_map_is_bright_where_much_is():
    heat = np.zeros((4, 6))
    heat[1, 2] = 3.0
    picture = cv2.imdecode(np.frombuffer(heat_png(heat, cell=5), np.uint8), cv2.IMREAD_GRAYSCALE)
    assert picture.shape == (20, 30)
    assert picture[7, 12] > 200 and picture[0, 0] < 10
    assert heat_png(np.zeros((2, 2))).startswith(b"\x89PNG")
