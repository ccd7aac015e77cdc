"""Figures of labels: against stored results, against other definitions of the same thing, and by hand."""

from __future__ import annotations

import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from aerojax.evaluate.answers import video_vote
from aerojax.evaluate.bootstrap import accuracy, bootstrap_interval, confusion_by_identity, paired_interval
from aerojax.evaluate.calibration import (
    BLUNTEST,
    SHARPEST,
    calibration_error,
    calibration_error_by_chance,
    fit_temperature,
    with_temperature,
)
from aerojax.evaluate.labels import cohen_kappa, confusion_matrix, gorodkin_mcc, label_figures, macro_auc, macro_f1


def log_softmax(logits):
    return np.asarray(jax.nn.log_softmax(jnp.asarray(logits)))


@pytest.mark.parametrize("level", ["clip", "video"])
def test_figures_are_the_stored_ones(shared, x64, level):
    golden = np.load(shared / "golden/classifier/video_vote.npz")
    if level == "clip":
        given, label = log_softmax(golden["clip_logits"].astype(np.float64)), golden["clip_labels"]
    else:
        # Votes in float32, as stored: its rounding decides how video 4's two equal classes compare.
        votes = video_vote(jnp.asarray(golden["clip_logits"]), jnp.asarray(golden["video_idx"]), 5)
        given, label = np.log(np.asarray(votes, np.float64)), golden["video_labels"]
    figures = label_figures(given, label)
    names = {"nll": "nll", "brier": "brier", "kappa": "cohen_kappa", "mcc": "mcc", "macro_f1": "macro_f1"}
    for ours, theirs in names.items():
        assert figures[ours] == pytest.approx(float(golden[f"{level}/{theirs}"]), abs=2e-6), ours
    assert figures["auc"] == pytest.approx(float(golden[f"{level}/macro_auc_roc"]), abs=1e-9)
    np.testing.assert_array_equal(figures["confusion"], golden[f"{level}/confusion_matrix"])
    assert figures["accuracy"] == pytest.approx(float(golden[f"{level}_acc"]))
    np.testing.assert_allclose(figures["recall"], golden[f"{level}_class_acc"])
    assert json.loads(json.dumps(figures)) == figures


def test_likelihood_is_the_unsmoothed_loss(shared):
    golden = np.load(shared / "golden/classifier/loss.npz")
    figures = label_figures(log_softmax(golden["logits"].astype(np.float32)), golden["labels"])
    assert figures["nll"] == pytest.approx(float(golden["mean_eps0.0"]), abs=1e-5)


def test_an_exact_tie_goes_to_the_lowest_class():
    figures = label_figures(np.log(np.array([[0.1, 0.4, 0.1, 0.4]])), np.array([1]))
    assert figures["accuracy"] == 1.0


def test_two_classes_have_the_textbook_correlation_and_agreement():
    confusion = np.array([[20, 5], [10, 15]])
    # Cohen's own kind of example: p_o = 0.7, p_e = 0.5·0.6 + 0.5·0.4.
    assert cohen_kappa(confusion) == pytest.approx((0.7 - 0.5) / 0.5)
    assert gorodkin_mcc(confusion) == pytest.approx((20 * 15 - 5 * 10) / np.sqrt(25 * 30 * 20 * 25))
    constant = np.array([[7, 0], [0, 0]])
    assert cohen_kappa(constant) is None and gorodkin_mcc(constant) == 0.0


def test_area_counts_equal_scores_half():
    rng = np.random.default_rng(0)
    score, label = rng.integers(0, 4, (60, 3)).astype(float), rng.integers(0, 3, 60)
    expected = []
    for c in range(3):
        difference = score[label == c, c][:, None] - score[label != c, c][None, :]
        expected.append(np.mean((difference > 0) + 0.5 * (difference == 0)))
    assert macro_auc(score, label) == pytest.approx(np.mean(expected))
    assert macro_auc(np.zeros((4, 2)), np.array([0, 0, 1, 1])) == 0.5
    assert macro_auc(score[:3], np.zeros(3, int)) is None


def test_macro_f1_of_many_matrices_at_once():
    stack = np.array([[[2, 0], [1, 1]], [[3, 1], [0, 0]]])
    # Second matrix: class 1 has no example, so class 0 alone counts: 2·3/(4+3).
    np.testing.assert_allclose(macro_f1(stack), [(4 / 5 + 2 / 3) / 2, 6 / 7])


def test_temperature_is_found_again():
    rng = np.random.default_rng(1)
    logits = 2 * rng.normal(size=(20000, 4))
    label = np.argmax(logits + rng.gumbel(size=logits.shape), axis=1)  # drawn with softmax(logits)
    assert fit_temperature(log_softmax(3 * logits), label) == pytest.approx(3, rel=0.05)
    over = log_softmax(3 * logits)
    mended = with_temperature(over, fit_temperature(over, label))
    assert calibration_error(mended, label) < 0.02 < 0.1 < calibration_error(over, label)
    np.testing.assert_array_equal(np.argmax(mended, axis=1), np.argmax(over, axis=1))
    np.testing.assert_allclose(np.exp(mended).sum(axis=1), 1.0)


def test_temperature_minimises_the_likelihood_and_stays_in_its_bounds():
    rng = np.random.default_rng(2)
    given, label = log_softmax(rng.normal(size=(50, 4))), rng.integers(0, 4, 50)
    best = fit_temperature(given, label)
    losses = [label_figures(with_temperature(given, best * f), label)["nll"] for f in (0.97, 1.0, 1.03)]
    assert best == pytest.approx(BLUNTEST) or losses[1] <= min(losses[0], losses[2])
    assert fit_temperature(given, np.argmax(given, axis=1)) == pytest.approx(SHARPEST)


def test_calibration_error_by_hand():
    given = np.log(np.array([[0.95, 0.05], [0.95, 0.05], [0.65, 0.35], [0.45, 0.55]]))
    # Bins of 0.1: two of confidence 0.95 with one right, 0.65 right, 0.55 wrong.
    expected = (abs(1 - 1.9) + abs(1 - 0.65) + abs(0 - 0.55)) / 4
    assert calibration_error(given, np.array([0, 1, 0, 0]), bins=10) == pytest.approx(expected)


def test_intervals_rest_on_identities():
    rng = np.random.default_rng(3)
    identity = [f"{i:02d}" for i in range(30) for _ in range(20)]
    # Clips of an identity are all right or all wrong: 600 clips are worth 30 examples.
    right = np.repeat(rng.random(30) < 0.7, 20)
    label = np.zeros(600, int)
    together = confusion_by_identity(np.where(right, 0, 1), label, identity, 2)
    assert together.shape == (30, 2, 2) and together.sum() == 600
    low, high = bootstrap_interval(together, accuracy, seed=0)
    share, error = right.mean(), np.sqrt(right.mean() * (1 - right.mean()) / 30)
    assert low == pytest.approx(share - 1.96 * error, abs=0.04) and high == pytest.approx(
        share + 1.96 * error, abs=0.04
    )
    alone = confusion_by_identity(np.where(right, 0, 1), label, [f"{i:03d}" for i in range(600)], 2)
    narrow = bootstrap_interval(alone, accuracy, seed=0)
    assert narrow[1] - narrow[0] < 0.3 * (high - low)
    assert bootstrap_interval(together, accuracy, seed=0) == (low, high)


def test_pairing_cancels_what_is_hard_for_both():
    rng = np.random.default_rng(4)
    identity, label = [f"{i:03d}" for i in range(40)], np.zeros(40, int)
    hard = rng.random(40) < 0.4
    first = np.where(hard, 1, 0)
    second = np.where(hard | (np.arange(40) < 4), 1, 0)
    pair = [confusion_by_identity(p, label, identity, 2) for p in (first, second)]
    low, high = paired_interval(*pair, accuracy, seed=0)
    assert 0 <= low < high < 0.3
    apart = [bootstrap_interval(one, accuracy, seed=0) for one in pair]
    assert high - low < min(b - a for a, b in apart)
    assert paired_interval(pair[0], pair[0], accuracy, seed=0) == (0.0, 0.0)


def test_label_figures_by_hand():
    log_probabilities = np.log(np.array([[0.7, 0.1, 0.1, 0.1], [0.4, 0.3, 0.2, 0.1], [0.1, 0.1, 0.7, 0.1]]))
    figures = label_figures(log_probabilities, np.array([0, 1, 2]))
    assert figures["accuracy"] == pytest.approx(2 / 3)
    assert figures["nll"] == pytest.approx(-np.log([0.7, 0.3, 0.7]).mean())
    assert figures["recall"] == [1.0, 0.0, 1.0, None]
    # F1: bird 2·1/(1+2), drone 0, airplane 1; the helicopter has no example.
    assert figures["macro_f1"] == pytest.approx((2 / 3 + 0 + 1) / 3)
    assert figures["confusion"] == [[1, 0, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 0]]
    assert json.loads(json.dumps(figures)) == figures
    np.testing.assert_array_equal(confusion_matrix(np.array([1, 1]), np.array([0, 0]), 2), [[0, 2], [0, 0]])


def test_the_calibration_error_that_few_clips_show_by_chance():
    """Of two clips with 0.75, both right or one or none: gaps of 0.25, 0.25 and 0.75."""
    given = np.log(np.tile([0.75, 0.25, 0.0, 0.0], (2, 1)) + 1e-12)
    found = calibration_error_by_chance(given, seed=0, draws=4000)
    chance = {2: 0.75**2, 1: 2 * 0.75 * 0.25, 0: 0.25**2}
    assert found["mean"] == pytest.approx(sum(chance[n] * abs(n / 2 - 0.75) for n in chance), abs=0.01)
    assert found["upper_95"] == pytest.approx(0.75)  # which 6 % show
    many = calibration_error_by_chance(np.tile(given, (2000, 1)), seed=0, draws=20)
    assert many["upper_95"] < 0.02
