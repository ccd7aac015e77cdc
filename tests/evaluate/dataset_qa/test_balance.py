"""Balance of classes as the thesis prints it, and composition by hand."""

from __future__ import annotations

import pytest
from support.dataset_entries import sequence

from aerojax.evaluate.dataset_qa.balance import compositions, entropy_ratio, gini_simpson


@pytest.mark.parametrize(
    ("counts", "entropy", "gini"),
    [
        # Table 6.3 of the thesis: bird, drone, helicopter, airplane.
        ((9000, 9000, 4800, 4800), 0.966, 0.727),
        ((3600, 4200, 2400, 2400), 0.978, 0.735),
        ((4800, 4800, 2400, 2400), 0.959, 0.722),
        ((2700, 2700, 1440, 1440), 0.966, 0.727),
        ((1080, 1260, 720, 720), 0.978, 0.735),
        ((960, 960, 480, 480), 0.959, 0.722),
        ((5, 5, 5, 5), 1.0, 0.75),
        ((5, 0, 0, 0), 0.0, 0.0),
        ((0, 0, 0, 0), 0.0, 0.0),
    ],
)
def test_balance_is_what_the_thesis_prints(counts, entropy, gini):
    assert entropy_ratio(counts) == pytest.approx(entropy, abs=5e-4)
    assert gini_simpson(counts) == pytest.approx(gini, abs=5e-4)


def test_composition_counts_moments_of_the_first_object():
    entries = (
        sequence("a", "bird", "train", 30, "drone_x"),
        sequence("a", "bird", "train", 30),
        sequence("b", "helicopter", "train", 10),
        sequence("c", "drone", "test", 5),
    )
    train, test = compositions(entries)
    assert (train.identities, train.sequences, train.frames) == (2, 3, 70)
    assert train.frames_by_class == (60, 0, 0, 10)  # bird, drone, airplane, helicopter
    assert (test.split, test.frames_by_class) == ("test", (0, 5, 0, 0))
