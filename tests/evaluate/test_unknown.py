"""Figures of what is called unknown, by hand: ranking, shares, false alarms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aerojax.evaluate.unknown import (
    JudgedClips,
    alarms,
    join_judged,
    recall_at,
    rejection,
    separation,
    set_figures,
    shares_by,
)


def judged(drone, strangeness, familiarity, group=None):
    """Clips that are drones with the given probabilities and birds otherwise."""
    drone = np.array(drone)
    rows = np.stack([0.98 - drone, drone, np.full(len(drone), 0.01), np.full(len(drone), 0.01)], axis=1)
    names = tuple(f"one_{i}" for i in range(len(drone)))
    return JudgedClips(
        np.log(rows), np.array(strangeness), np.array(familiarity), names, tuple(group or ["rig"] * len(drone))
    )


KNOWN = judged([0.9, 0.8, 0.1, 0.7], [1.0, 2.0, 1.5, 3.5], [0.9, 0.4, 0.6, 0.04], ["a", "a", "b", "b"])
LABEL = np.array([1, 1, 0, 0])  # the last one is a bird that is taken for a drone, and looks strange
STRANGE = judged([0.95, 0.6, 0.3], [4.0, 3.0, 1.8], [0.01, 0.02, 0.5], ["ball", "box", "box"])


def test_ranking_by_strangeness_and_by_probability():
    found = separation(KNOWN, STRANGE, seed=0, draws=50)
    # Of the 12 pairs, 4.0 is above all four, 3.0 and 1.8 above three and two of them.
    assert found["auroc"] == pytest.approx((4 + 3 + 2) / 12)
    low, high = found["auroc_interval_95"]
    assert 0 <= low <= found["auroc"] <= high <= 1 and low < high
    # Surest: known 0.9 0.8 0.88 0.7, strange 0.95 0.6 0.68, of which the last two are less sure than all known ones.
    assert found["auroc_of_probability"] == pytest.approx(8 / 12)
    assert separation(KNOWN, STRANGE, seed=0, draws=50) == found


def test_shares_at_a_level():
    found = rejection(KNOWN, LABEL, STRANGE, 0.05)
    assert found["accuracy"] == 0.75 and found["accuracy_of_answered"] == 1.0
    assert found["known_called_unknown"] == 0.25 and found["known_by_class"] == {"bird": 0.5, "drone": 0.0}
    assert found["known_by_group"] == {"a": 0.0, "b": 0.5}
    assert found["strange_called_unknown"] == pytest.approx(2 / 3)
    assert found["strange_by_group"] == {"ball": 1.0, "box": 0.5}
    assert found["strange_sure"] == pytest.approx(1 / 3)  # the one that is left has 0.68 for a bird
    assert rejection(KNOWN, LABEL, STRANGE, 0.0)["known_called_unknown"] == 0.0
    everything = replace(KNOWN, familiarity=np.zeros(4))
    assert rejection(everything, LABEL, STRANGE, 0.05)["accuracy_of_answered"] is None
    assert shares_by(np.array([True, False]), ["x", "x"]) == {"x": 0.5}


def test_recall_where_so_many_negatives_may_pass():
    positive, negative = np.array([0.9, 0.5, 0.2]), np.linspace(0.0, 1.0, 11)
    assert recall_at(positive, negative, 0.0) == 0.0  # nothing is above the highest negative
    assert recall_at(positive, negative, 0.1) == pytest.approx(0.0)  # one may pass, and 0.9 is the next
    assert recall_at(positive, negative, 0.2) == pytest.approx(1 / 3)
    assert recall_at(positive, negative, 1.0) == 1.0


def test_false_alarms_fall_where_strange_things_are_unknown():
    found = alarms(KNOWN, LABEL, STRANGE, 0.05)
    assert found["class"] == "drone"
    plain, with_unknown = found["plain"], found["with_unknown"]
    assert (plain["recall"], plain["other_classes"]) == (1.0, 0.5) and plain["outliers"] == pytest.approx(2 / 3)
    assert with_unknown["recall"] == 1.0 and with_unknown["other_classes"] == with_unknown["outliers"] == 0.0
    assert plain["recall_at_rate"]["5%"] == 0.0  # the strangest is the likeliest drone of all
    assert with_unknown["recall_at_rate"]["5%"] == 1.0


def test_sets_join_in_order():
    both = join_judged([KNOWN, STRANGE])
    assert both.group == KNOWN.group + STRANGE.group and both.identity == KNOWN.identity + STRANGE.identity
    np.testing.assert_array_equal(both.strangeness, [*KNOWN.strangeness, *STRANGE.strangeness])
    assert both.surest[-1] == pytest.approx(0.68)


def test_sets_of_classes():
    held = np.array([[1, 0, 0, 0], [1, 1, 0, 0], [0, 1, 1, 1], [0, 0, 0, 1]], bool)
    found = set_figures(held, np.array([0, 1, 0, 0]), ["a", "a", "a", "b"])
    assert found["coverage"] == 0.5 and found["coverage_of_families"] == pytest.approx((2 / 3 + 0) / 2)
    assert (found["families"], found["mean_size"], found["single"], found["single_right"]) == (2, 1.75, 0.5, 0.5)
    assert set_figures(held[1:3], np.array([1, 1]), ["a", "b"])["single_right"] is None
    both = join_judged([replace(KNOWN, held=held), replace(KNOWN, held=held[:, ::-1])])
    assert both.held is not None and both.held.shape == (8, 4)
    assert join_judged([KNOWN, STRANGE]).held is None
