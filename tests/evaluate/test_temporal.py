"""What frames and their order do: shares with intervals, groups, and shuffled clips, by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aerojax.core.types import CLASSES
from aerojax.data.clips import ClipSet
from aerojax.evaluate.temporal import TemporalAnswers, TemporalTrials, share, shuffled_frames, temporal_figures
from aerojax.view.temporal import temporal_plots

PLAN = TemporalTrials(draws=200, distances=(0.0, 45.0, 400.0))


@pytest.fixture
def answers() -> TemporalAnswers:
    """Two clips of each class, near and far; the second frame mends the far ones, shuffling loses the birds."""
    label = np.repeat(np.arange(len(CLASSES)), 2)
    near = np.tile([True, False], len(CLASSES))
    right = np.stack([near, np.ones(8, bool)], axis=1)
    predicted = np.where(right, label[:, None], (label[:, None] + 1) % len(CLASSES))
    shuffled = np.where(label == CLASSES.index("bird"), 0.25, 1.0)
    names = tuple(f"individual_{i}" for i in range(8))
    return TemporalAnswers(right, predicted, shuffled, label, names, np.where(near, 16.0, 280.0))


def test_figures_by_class_and_distance(answers):
    found = temporal_figures(answers, CLASSES, PLAN)
    by_class = {name: {row["class"]: row["accuracy"] for row in found[name]} for name in ("first", "gains", "shuffled")}
    assert by_class["first"]["all"] == 0.5 and by_class["gains"]["drone"] == 0.5
    assert by_class["shuffled"] == {"all": 0.75 / 4, "bird": 0.75, "drone": 0.0, "airplane": 0.0, "helicopter": 0.0}
    assert found["fall"]["accuracy"] == 0.0 and found["gain_falls"]["accuracy"] == -1.0
    assert found["gain_falls"]["low"] == found["gain_falls"]["high"] == -1.0
    beside = {row["class"]: row["accuracy"] for row in found["gains_beside_others"]}
    assert list(beside) == list(CLASSES) and beside["helicopter"] == 0.0
    near, far = (row for row in found["distance_m"] if row["class"] == "bird")
    assert near["to_m"] == 45.0 and far["when_shuffled"] == 0.25 and far["clips"] == 1
    assert found["frames_by_distance"][1]["accuracy"] == [0.0, 1.0]
    assert np.trace(found["confusion"]["whole"]) == 8 and np.trace(found["confusion"]["first"]) == 4
    prefixes = [row["accuracy"] for row in found["prefixes"] if row["class"] == "all"]
    assert prefixes == [0.5, 1.0] and {row["name"] for row in found["ranges"]} == {"near", "far"}


def test_individuals_are_drawn_and_not_clips():
    """One individual's clips stand together, so ten of them say no more than one."""
    values, names = np.repeat([0.0, 1.0], 10), ("a",) * 10 + ("b",) * 10
    found = share(values, np.ones(20), names, PLAN)
    assert found["accuracy"] == 0.5 and (found["low"], found["high"]) == (0.0, 1.0)
    apart = share(values, np.ones(20), tuple(map(str, range(20))), PLAN)
    assert 0.2 < apart["low"] < 0.5 < apart["high"] < 0.8


def test_shuffled_frames_are_the_same_frames_with_absent_ones_last():
    columns = np.arange(2 * 4 * 3 * 14, dtype=np.float32).reshape(2, 4, 3, 14)
    present = np.array([[True] * 4, [True, True, True, False]])
    clips = ClipSet(columns, present, np.zeros(2, np.int64), ("a", "b"))
    moved = shuffled_frames(clips, seed=1)
    assert moved.present.tolist() == present.tolist() and moved.crops is None
    assert not np.array_equal(moved.columns, columns)
    for before, after in zip(columns, moved.columns, strict=True):
        assert {frame.tobytes() for frame in before} == {frame.tobytes() for frame in after}
    np.testing.assert_array_equal(moved.columns[1, 3], columns[1, 3])


def test_every_plot_is_a_file_of_its_own(answers):
    plots = temporal_plots("network", temporal_figures(answers, CLASSES, PLAN), CLASSES)
    assert list(plots) == ["frames", "distance", "shuffled", "frames_by_distance"]
    assert all(text.startswith("<svg") and "polyline" in text for text in plots.values())
    unknown = replace(answers, distance=np.full(8, np.nan))
    assert list(temporal_plots("network", temporal_figures(unknown, CLASSES, PLAN), CLASSES)) == ["frames"]
