"""Rows of an ablation: their order, means over seeds, paired differences, averaged answers and their calibration."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from aerojax.core.types import CLASSES
from aerojax.evaluate.ablation import (
    HEAD,
    ablation_markdown,
    ablation_rows,
    answers_from_json,
    answers_to_json,
    averaged,
)
from aerojax.evaluate.groups import AnsweredClips

CLIPS = 8


def answers(probability_of_truth: list[float]) -> AnsweredClips:
    """Of individuals of all classes in turn; what is left is the next class's."""
    label = np.arange(len(probability_of_truth)) % len(CLASSES)
    share = np.full((len(label), len(CLASSES)), 1e-3)
    share[np.arange(len(label)), (label + 1) % len(CLASSES)] = 1 - np.array(probability_of_truth)
    share[np.arange(len(label)), label] = probability_of_truth
    names = tuple(f"individual_{i}" for i in range(len(label)))
    facts = tuple({"width_px": 30.0, "rig": "rig"} for _ in names)
    rows = np.log(share / share.sum(axis=1, keepdims=True))
    return AnsweredClips(label, names, facts, rows, np.ones(len(label), bool))


def run(name: str, against: str, seed: int, right: int, *, sure: float = 0.9) -> dict[str, Any]:
    """Contents of a `comparison.json` whose first `right` clips are answered rightly, with the probability `sure`."""
    head = dict.fromkeys(HEAD, 0) | {"classifier": name, "change": f"change of {name}", "against": against}
    tested = answers([sure] * right + [1 - sure] * (CLIPS - right))
    parts = {"sim1": tested, "sim3": answers([sure] * CLIPS), "val": answers([0.9] * 9 + [0.1])}
    kept = {folder: answers_to_json(part) for folder, part in parts.items()}
    return head | {"seed": seed, "minutes": 1.0, "counted": ["sim1"], "answers": json.loads(json.dumps(kept))}


def test_answers_survive_a_file():
    one = answers([0.9, 0.2, 0.6])
    again = answers_from_json(json.loads(json.dumps(answers_to_json(one))))
    assert again.identity == one.identity and again.facts == one.facts
    np.testing.assert_array_equal(again.exists, one.exists)
    np.testing.assert_allclose(again.log_probabilities, one.log_probabilities, atol=1e-6)


def test_a_sure_network_outvotes_an_unsure_one():
    both = averaged([answers([0.9, 0.4]), answers([0.3, 0.45])])
    np.testing.assert_allclose(np.exp(both.log_probabilities).sum(axis=1), 1.0)
    assert (both.predicted == both.label).tolist() == [True, False]


def test_a_row_stands_behind_the_one_that_it_is_held_against():
    names = [("c", "b"), ("b", "a"), ("d", "a"), ("a", "")]
    rows = ablation_rows([run(name, against, 0, 4) for name, against in names], draws=10)
    assert [row["classifier"] for row in rows] == ["a", "b", "c", "d"]
    alone = ablation_rows([run("b", "a", 0, 4)], draws=10)
    assert alone[0]["difference"] is None and "| b | change of b |" in ablation_markdown(alone)


def test_figures_are_means_over_seeds_and_differences_paired():
    runs = [run("a", "", 0, 4), run("a", "", 1, 6), run("b", "a", 0, 8), run("b", "a", 1, 6)]
    first, second = ablation_rows(runs, draws=500)
    assert first["seeds"] == [0, 1] and first["tests"]["all"]["accuracy"]["mean"] == 5 / 8
    assert first["tests"]["all"]["accuracy"]["std"] == pytest.approx(np.std([4 / 8, 6 / 8], ddof=1))
    assert first["tests"]["sim3"]["accuracy"] == {"mean": 1.0, "std": 0.0}
    gap = second["difference"]
    assert gap["accuracy"] == pytest.approx(2 / 8) and 0 <= gap["low"] < gap["accuracy"] < gap["high"]
    assert second["averaged"]["networks"] == 2 and second["averaged"]["width_px"][0]["clips"] == CLIPS
    page = ablation_markdown([first, second])
    assert "| 62.5 ± 17.7 (" in page and "+25.0 (" in page and "than a |" in page


def test_the_temperature_is_that_of_validation():
    # Nine of ten validation clips are right, all with 0.9: the temperature stays 1 and mends nothing.
    (row,) = ablation_rows([run("a", "", 0, CLIPS, sure=0.9)], draws=10)
    assert row["averaged"]["temperature"] == pytest.approx(1.0, abs=0.05)
    figures = row["averaged"]["tests"]["all"]
    assert figures["ece"] == pytest.approx(0.1, abs=2e-3)
    assert figures["ece_with_temperature"] == pytest.approx(figures["ece"], abs=0.01)
