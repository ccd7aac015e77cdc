"""What is wrong is chosen by what it explains, and what is known of the rest is told."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerojax.track.adjust.corrections import OFFSET_RATE, SHIFT, TURN
from aerojax.track.adjust.evidence import Evidence, choose


@dataclass(frozen=True, eq=False)
class Straight:
    """Corrections that are linear in what is seen: least squares with a known answer."""

    seen_by: np.ndarray
    seen: np.ndarray

    def solved(self, looked, guess):
        found, places = np.zeros(looked.shape), np.flatnonzero(looked)
        if len(places):
            found.flat[places] = np.linalg.lstsq(self.seen_by[:, places], self.seen, rcond=None)[0]
        return found, float(np.sum((self.seen_by @ found.ravel() - self.seen) ** 2))

    def evidence(self, guess):
        off = self.seen_by @ guess.ravel() - self.seen
        return Evidence(self.seen_by.T @ self.seen_by, self.seen_by.T @ off, float(np.log(len(off))))

    def values(self, guess):
        return guess


def straight(true: np.ndarray) -> Straight:
    rng = np.random.default_rng(0)
    seen_by = rng.normal(size=(400, true.size))
    seen_by[:, 15:18] = seen_by[:, 12:15] + 0.2 * seen_by[:, 15:18]  # the second camera's turn and shift are alike
    return Straight(seen_by, seen_by @ true.ravel() + rng.normal(size=400))


def test_only_what_is_wrong_is_looked_for():
    may = np.ones((3, 9), bool)
    for part in (TURN, SHIFT):
        true = np.zeros((3, 9))
        true[1, part] = [1.0, -0.7, 0.5]
        looked, found = choose(straight(true), np.zeros((3, 9), bool), may, np.zeros((3, 9)))
        np.testing.assert_array_equal(looked, true != 0)
        np.testing.assert_allclose(found[looked], true[looked], atol=0.2)


def test_what_was_looked_for_and_means_nothing_is_given_up():
    true = np.zeros((3, 9))
    true[2, OFFSET_RATE] = 2.0
    begin = np.zeros((3, 9), bool)
    begin[1:, OFFSET_RATE] = begin[0, TURN] = True
    looked, _ = choose(straight(true), begin, np.ones((3, 9), bool), np.zeros((3, 9)))
    np.testing.assert_array_equal(looked, true != 0)


def test_deviations_of_what_is_looked_for_and_of_what_could_be():
    about = straight(np.zeros((3, 9))).evidence(np.zeros((3, 9)))
    looked, may = np.zeros((3, 9), bool), np.ones((3, 9), bool)
    looked[0, TURN] = True
    may[2] = False
    sigma = about.sigmas(looked, may)
    expected = np.sqrt(np.diag(np.linalg.inv(about.curvature[3:6, 3:6])))
    np.testing.assert_allclose(sigma[0, TURN], expected)
    assert np.all(sigma[1, TURN] > 0) and np.all(sigma[2] == 0)
    assert np.all(Evidence(about.curvature, about.slope, 1.0, 4.0).sigmas(looked, may)[looked] == 2 * sigma[looked])


def test_offsets_at_another_moment():
    """An offset and a rate that are known on their own at 10 s, seen at 0 s."""
    independent = np.diag(np.tile([1e6, 4e8, *[1.0] * 7], 2))
    step = np.eye(18)
    step[0, 1] = step[9, 10] = 10.0  # what is late at 10 s is the offset and ten seconds of the rate
    about = Evidence(step.T @ independent @ step, np.zeros(18), 1.0)
    looked = np.zeros((2, 9), bool)
    looked[1, OFFSET_RATE] = True
    np.testing.assert_allclose(about.at(10.0).sigmas(looked, looked)[1, :2], [1e-3, 5e-5])
    assert about.sigmas(looked, looked)[1, 0] > 1.1e-3
