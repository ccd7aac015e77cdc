"""Scenes, a trained reconstructor, and its row in the table, each act at its smallest."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from support.command_line import run_command

from experiments import eval_reconstructor, generate_views, train_reconstructor

SMALL = (
    *("reconstruct=lgm", "model.size=16", "model.down=[16,16]", "model.up=[16]"),
    *("model.attends_down=[false,true]", "model.attends_up=[false]"),
)


@pytest.mark.long
def test_views_are_made_a_reconstructor_trained_and_measured(tmp_path, monkeypatch):
    where = f"folder={tmp_path}/views"
    for split in ("train", "val"):
        run = f"hydra.run.dir={tmp_path}/views_{split}"
        run_command(generate_views, monkeypatch, "preset=smoke", where, f"split={split}", "workers=1", run)
    assert sorted(p.name for p in (tmp_path / "views").iterdir()) == ["train", "val", "views.json"]
    run = f"hydra.run.dir={tmp_path}/train"
    run_command(train_reconstructor, monkeypatch, "preset=smoke", f"views=[{tmp_path}/views]", *SMALL, run)
    record = json.loads((tmp_path / "train" / "metrics.json").read_text())
    assert record["scenes"]["train"] == 4 and record["parameters"] > 1000 and record["command"].count("lgm")
    weights = tmp_path / "train" / "weights.safetensors"
    run = f"hydra.run.dir={tmp_path}/eval"
    run_command(
        eval_reconstructor, monkeypatch, "preset=smoke", f"weights=[{weights}]", f"assets={tmp_path}/assets", run
    )
    _check(tmp_path / "eval")


def _check(directory: Path) -> None:
    results = json.loads((directory / "results.json").read_text())
    assert {row["member"] for row in results["rows"]} == {"constant", "hull", "lgm"}
    assert {row["factor"] for row in results["rows"]} == {"protocol", "masks", "distance"}
    assert all(0 <= row["iou"] <= 1 and row["chamfer_percent"] >= 0 for row in results["rows"])
    assert [row["parameters"] > 0 for row in results["cost"]] == [False, False, True]
    assert all(row["ms"] > 0 for row in results["cost"]) and results["commit"] is not None
    assert (directory / "sheet_test_identities.png").stat().st_size > 500
