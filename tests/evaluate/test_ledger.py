"""Verdicts on claims, figures that stand in results/, and the page: it is the one that the results make."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from aerojax.core.errors import UserError
from aerojax.evaluate.ledger import VERDICTS, Claim, Figure, figure_of, ledger_of, read_claims, verdict
from aerojax.evaluate.ledger_page import ledger_markdown, shown

ROOT = Path(__file__).resolve().parents[2]
RESULTS, PAGE = ROOT / "results", ROOT / "docs/ledger.md"


def claim(rule, *, figure=0.7, own=True, tolerance=0.0) -> Claim:
    return Claim(source="Table 1", text="A is so.", rule=rule, figure=figure, own=own, tolerance=tolerance)


@pytest.mark.parametrize(
    ("rule", "figure", "own", "expected"),
    [
        ("more", Figure(0.8, 0.75, 0.85), True, "beaten"),
        ("more", Figure(0.8, 0.65, 0.9), True, "undecided"),  # an absolute figure of other data is no reproduction
        ("more", Figure(0.8, 0.65, 0.9), False, "reproduced"),
        ("more", Figure(0.5, 0.4, 0.6), True, "contradicted"),
        ("less", Figure(0.5, 0.4, 0.6), True, "beaten"),
        ("less", Figure(0.8, 0.75, 0.85), True, "contradicted"),
        ("less", Figure(0.5), True, "beaten"),
        ("above", Figure(0.1, 0.05, 0.2), True, "reproduced"),
        ("above", Figure(0.1, -0.05, 0.2), True, "undecided"),
        ("above", Figure(-0.1, -0.2, -0.05), True, "contradicted"),
        ("above", Figure(0.0, 0.0, 0.0), True, "contradicted"),
        ("below", Figure(-0.1, -0.2, -0.05), True, "reproduced"),
        ("below", Figure(0.1, 0.05, 0.2), True, "contradicted"),
        ("below", Figure(-0.1, -0.2, 0.05), True, "undecided"),
        ("bound", Figure(0.7), True, "reproduced"),
        ("bound", Figure(0.71), True, "contradicted"),
        ("over", Figure(0.71), True, "reproduced"),
        ("over", Figure(0.7), True, "contradicted"),
        ("over", Figure(0.75, 0.6, 0.9), True, "undecided"),
        ("equal", Figure(0.7), True, "reproduced"),
        ("equal", Figure(0.701), True, "contradicted"),
        ("above", None, True, "not measured"),
    ],
)
def test_the_rules(rule, figure, own, expected):
    assert verdict(claim(rule, own=own), figure) == expected


def test_a_bound_holds_by_its_whole_interval():
    assert verdict(claim("bound"), Figure(0.6, 0.5, 0.65)) == "reproduced"
    assert verdict(claim("bound"), Figure(0.65, 0.5, 0.8)) == "undecided"
    assert verdict(claim("bound"), Figure(0.9, 0.8, 1.0)) == "contradicted"


def test_a_tolerance_is_of_equality():
    assert verdict(claim("equal", tolerance=0.01), Figure(0.705)) == "reproduced"


@pytest.fixture
def results(tmp_path) -> Path:
    rows = [
        {"name": "a", "share": {"mean": 0.8, "std": 0.02}, "seeds": [0, 1, 2]},
        {
            "name": "b",
            "share": {"mean": 0.7, "std": 0.0},
            "seeds": [0, 1, 2],
            "gap": {"v": 0.1, "low": 0.0, "high": 0.2},
        },
    ]
    (tmp_path / "one.json").write_text(
        json.dumps({"rows": rows, "command": "act", "seed": 0, "commit": "1234567890+c"})
    )
    return tmp_path


def test_a_difference_of_means_has_an_interval_over_seeds(results):
    asked = Claim(source="", text="", result="one", ours="rows[name=a].share", seeds="rows[name=a].seeds")
    alone = figure_of(asked, results)
    assert alone is not None and alone.value == 0.8
    half = 4.303 * 0.02 / np.sqrt(3)  # Student's t of two degrees of freedom
    assert alone.low == pytest.approx(0.8 - half) and alone.high == pytest.approx(0.8 + half)
    both = Claim(
        source="",
        text="",
        result="one",
        ours="rows[name=a].share",
        minus="rows[name=b].share",
        seeds="rows[name=a].seeds",
    )
    found = figure_of(both, results)
    assert found is not None and found.value == pytest.approx(0.1)
    assert found.low == pytest.approx(0.1 - 2.776 * np.sqrt(0.02**2 / 3))


def test_one_seed_has_the_interval_over_individuals(tmp_path):
    rows = [{"share": {"mean": mean, "std": None, "interval_95": [mean - 0.1, mean + 0.1]}} for mean in (0.75, 0.5)]
    (tmp_path / "one.json").write_text(json.dumps({"rows": rows, "seeds": [0]}))
    found = figure_of(
        Claim(source="", text="", result="one", ours="rows[0].share", minus="rows[1].share", seeds="seeds"), tmp_path
    )
    assert found is not None and found.value == 0.25
    assert found.low == pytest.approx(0.05) and found.high == pytest.approx(0.45)


def test_an_interval_of_the_file_is_taken(results):
    asked = Claim(source="", text="", result="one", ours="rows[name=b].gap.v", interval="rows[name=b].gap")
    assert figure_of(asked, results) == Figure(0.1, 0.0, 0.2)


def test_a_file_that_is_not_there_is_no_measurement(results):
    assert figure_of(Claim(source="", text="", result="two", ours="x"), results) is None
    assert figure_of(Claim(source="", text="", result="one", ours="rows[name=c].share"), results) is None
    with pytest.raises(UserError, match="has no rows"):
        figure_of(Claim(source="", text="", result="one", ours="rows[name=a].shore"), results)


def test_figures_as_they_are_shown():
    assert shown(Figure(0.977, 0.948, 1.0), ".1%") == "97.7 % (94.8 to 100.0)"
    assert shown(Figure(0.07, 0.03, 0.1), ".1%", difference=True) == "+7.0 points (+3.0 to +10.0)"
    assert shown(Figure(1852478.0), ",.0f") == "1,852,478"


def test_the_page_names_verdicts_commands_and_commits(results):
    asked = Claim(
        source="Table 1", text="A.", thesis="70 %", rule="more", figure=0.7, result="one", ours="rows[0].share"
    )
    page = ledger_markdown(ledger_of(results, (asked,)), results)
    assert "| A. | 70 % | 80.0 % | own | beaten | `one.json` |" in page
    assert "| `one.json` | `act` | 0, 1, 2 | 1234567 with changes |" in page and "| beaten | 1 |" in page


# The claims of the package


def test_every_claim_can_be_looked_up():
    """Every field that is named is in its file; a file that is missing is one that a command makes."""
    entries = ledger_of(RESULTS)
    assert {entry.verdict for entry in entries} <= set(VERDICTS)
    for entry in entries:
        one = entry.claim
        assert bool(one.result) == bool(one.ours), one.text
        assert one.result or one.note, f"{one.text}: what would it need?"


def test_claims_of_accuracy_have_intervals():
    """A share without an interval could be anything; those of one answer each are the exception."""
    for entry in ledger_of(RESULTS):
        if entry.figure is not None and entry.claim.rule in ("more", "above", "below"):
            assert entry.figure.low is not None or not entry.claim.shown.endswith("%"), entry.claim.text


def test_all_tables_and_figures_of_chapter_6_are_there():
    named = " ".join(one.source for one in read_claims())
    tables = [f"Table 6.{number}" for number in range(3, 21)]
    figures = [f"6.{number}" for number in (7, 8, 11, 12, *range(14, 19), 20)]
    assert [name for name in (*tables, *figures) if not re.search(rf"{re.escape(name)}\b", named)] == []


def test_the_committed_page_is_the_one_of_the_results():
    assert PAGE.read_text(encoding="utf-8") == ledger_markdown(ledger_of(RESULTS), RESULTS), (
        "run python -m experiments.reproduce"
    )
