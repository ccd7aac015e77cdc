"""Rows of a comparison of networks: turned windows, and whole clips held against the reference."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from aerojax.core.types import CLASSES
from aerojax.evaluate.ablation import HEAD, answers_to_json
from aerojax.evaluate.comparison import TABLES
from aerojax.evaluate.groups import AnsweredClips
from aerojax.evaluate.network_table import REFERENCE, WHOLE, image_rows, network_markdown, network_rows
from aerojax.evaluate.rotations import TEST_ROTATIONS

CLIPS = 8


def answers(right: int) -> AnsweredClips:
    """Of individuals of all classes in turn, of which the first `right` are answered rightly."""
    label = np.arange(CLIPS) % len(CLASSES)
    said = np.where(np.arange(CLIPS) < right, label, (label + 1) % len(CLASSES))
    rows = np.log(np.where(np.arange(len(CLASSES)) == said[:, None], 0.7, 0.1))
    names = tuple(f"individual_{i}" for i in range(CLIPS))
    return AnsweredClips(label, names, ({"width_px": 30.0},) * CLIPS, rows, np.ones(CLIPS, bool))


def run(name: str, seed: int, right: int, turned: float) -> dict[str, Any]:
    """Contents of a `comparison.json`; windows are answered as well as clips, and `turned` where they are turned."""
    parts = {"sim1": answers(right), "sim3": answers(CLIPS), "val": answers(6)}
    shares = {kind: right / CLIPS if kind == "none" else turned for kind in TEST_ROTATIONS}
    rotations = {
        kind: {
            "clip_accuracy": {"mean": share, "std": 0.0},
            "interval_95": {"video_accuracy": [share - 0.25, share + 0.25]},
        }
        for kind, share in shares.items()
    }
    return {
        **dict.fromkeys(HEAD, 0),
        **{"classifier": name, "label": f"network {name}", "against": "", "trained": "none", "seed": seed},
        **{"minutes": 1.0, "counted": ["sim1"], "windows": CLIPS, "last_frame": 0.25},
        "figures": {"rotations": rotations},
        "answers": {folder: answers_to_json(part) for folder, part in parts.items()},
    }


def test_every_row_is_held_against_the_reference_and_turned():
    runs = [run("vn", 0, 4, 0.5), run(REFERENCE, 0, 8, 1.0), run("vn", 1, 6, 0.75), run(REFERENCE, 1, 6, 0.75)]
    rows = network_rows(runs, draws=200)
    assert [row["classifier"] for row in rows] == [REFERENCE, "vn"]
    ours, theirs = rows
    assert ours["difference"] is None and theirs["difference"]["accuracy"] == pytest.approx(5 / 8 - 7 / 8)
    assert theirs["turned"]["so3"]["interval_95"] == [0.375, 0.875]
    assert theirs["turned"]["so3"]["mean"] == 0.625 and theirs["turned"]["none"]["mean"] == 5 / 8
    assert theirs["last_frame"] == {"mean": 0.25, "std": 0.0} and theirs["seeds"] == [0, 1]
    page = network_markdown(rows)
    assert "| vn | network vn | 0 | none | 62.5 ± 17.7 | 62.5 ± 17.7 |" in page
    assert "-25.0 (" in page and "| 100.0 ± 0.0 |" in page


def test_a_row_without_the_reference_is_a_table_too():
    rows_of, markdown_of = TABLES["baselines"]
    (row,) = rows_of([run("vn", 0, 4, 0.5)])
    assert row["difference"] is None and "tested SO(3) a frame" in markdown_of([row])


def test_images_are_held_against_those_that_are_read_together():
    runs = [run("b4_lite", 0, 4, 0.5), run(WHOLE, 0, 8, 1.0)]
    rows = {row["classifier"]: row for row in image_rows(runs, draws=200)}
    assert rows[WHOLE]["difference"] is None and rows["b4_lite"]["difference"]["accuracy"] == pytest.approx(-0.5)
    assert rows["b4_lite"]["change"] == "network b4_lite" and "turned" not in rows["b4_lite"]
