"""Figures of tracks against cases worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from aerojax.evaluate.tracking import TrackingFrame, gospa, owners, tracking_figures


def frame(truth: dict[int, float], said: dict[int, float]) -> TrackingFrame:
    """Objects and tracks on a line, by id."""

    def on_line(places: dict[int, float]) -> np.ndarray:
        return np.array([[x, 0.0, 0.0] for x in places.values()]).reshape(-1, 3)

    return TrackingFrame(np.array(list(truth), np.int64), on_line(truth), np.array(list(said), np.int64), on_line(said))


@pytest.mark.parametrize(
    ("truth", "said", "parts"),
    [
        ({1: 0.0}, {7: 3.0}, (9.0, 0.0, 0.0)),
        ({1: 0.0}, {7: 5.0}, (0.0, 12.5, 12.5)),  # as far as the cutoff is not found
        ({1: 0.0, 2: 10.0}, {7: 1.0}, (1.0, 12.5, 0.0)),
        ({}, {7: 1.0, 8: 2.0}, (0.0, 0.0, 25.0)),
        ({1: 0.0, 2: 4.0}, {7: 3.0, 8: 7.0}, (18.0, 0.0, 0.0)),  # 9 + 9, not 1 + 25/2·2
        ({}, {}, (0.0, 0.0, 0.0)),
    ],
)
def test_gospa_by_hand(truth, said, parts):
    found = gospa(frame(truth, said), cutoff=5.0)
    assert (found.localisation, found.missed, found.false) == pytest.approx(parts)
    assert found.distance == pytest.approx(sum(parts) ** 0.5)


def test_gospa_of_order_one():
    assert gospa(frame({1: 0.0, 2: 9.0}, {5: 1.0}), cutoff=4.0, order=1.0).distance == pytest.approx(1.0 + 2.0)


def test_identities_by_hand():
    """Two objects, four moments; a track changes from one to the other half-way."""
    frames = [frame({1: 0.0, 2: 9.0}, {5: 0.1, 6: 9.1}) for _ in range(3)]
    frames.append(frame({1: 0.0, 2: 9.0}, {5: 9.1, 6: 0.1}))
    figures = tracking_figures(frames)
    assert figures.idf1 == pytest.approx(2 * 6 / 16) and figures.switches == 2
    assert figures.ghosts == 0 and figures.missed == 0 and figures.rmse == pytest.approx(0.1)


def test_a_track_is_of_the_object_that_it_was_at_most_often():
    frames = [frame({1: 0.0, 2: 9.0}, {5: 0.1, 6: 9.1, 7: 40.0}) for _ in range(3)]
    frames.append(frame({1: 0.0, 2: 9.0}, {5: 9.1, 6: 0.1}))
    assert owners(frames) == {5: 1, 6: 2}


def test_ghosts_and_misses_by_hand():
    frames = [frame({1: 0.0}, {5: 0.5, 6: 30.0}), frame({1: 0.0}, {}), frame({1: 0.0}, {5: 2.0}), frame({}, {})]
    figures = tracking_figures(frames)
    assert figures.ghosts == pytest.approx(50.0)  # two in four moments
    assert figures.missed == pytest.approx(2 / 3)
    assert figures.id_recall == pytest.approx(1 / 3) and figures.id_precision == pytest.approx(1 / 3)
    assert figures.gospa == pytest.approx((np.sqrt(0.25 + 12.5) + np.sqrt(12.5) + 2.0 + 0.0) / 4)


def test_nothing_there_and_nothing_said_is_perfect():
    figures = tracking_figures([frame({}, {})])
    assert figures.idf1 == 1.0 and figures.ghosts == 0 and np.isnan(figures.rmse)
