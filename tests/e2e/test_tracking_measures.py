"""Tracks and masks measured at their smallest, with labels."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from support.command_line import run_command

from experiments import measure_segmentation, measure_tracking


def results(run: Path) -> dict:
    return json.loads((run / "results.json").read_text())


def test_tracks_of_detections(monkeypatch, tmp_path):
    asked = ("preset=smoke", "only=[tracks]", "flown.frames=30", f"hydra.run.dir={tmp_path}")
    run_command(measure_tracking, monkeypatch, *asked)
    found = results(tmp_path)
    assert list(found["rows"]) == ["tracks"] and found["summary"]["tracks"]["idf1"]["worst"] > 0.95


@pytest.mark.long
def test_what_is_wrong_with_cameras(monkeypatch, tmp_path):
    kinds = ("stagger", "clocks", "poses")
    asked = ("preset=smoke", f"only=[{','.join(kinds)}]", f"hydra.run.dir={tmp_path}")
    run_command(measure_tracking, monkeypatch, *asked)
    found = results(tmp_path)
    assert tuple(found["rows"]) == kinds and {len(rows) for rows in found["rows"].values()} == {1}
    summary = found["summary"]
    assert summary["stagger"]["idf1"]["worst"] > 0.95 and summary["stagger"]["ghosts"]["worst"] < 1
    assert summary["clocks"]["offset_error_ms"]["worst"] < 20 and found["rows"]["clocks"][0]["given"]["idf1"] < 0.9
    assert found["rows"]["poses"][0]["wrong"] == "position"


@pytest.mark.long
def test_tracks_and_labels_of_masks(monkeypatch, tmp_path):
    asked = ("preset=smoke", "only=[masks,masks_poses]", "dataset.frames=24", f"folder={tmp_path}/data")
    run_command(measure_tracking, monkeypatch, *asked, f"hydra.run.dir={tmp_path}/run")
    found = results(tmp_path / "run")
    (row,), (wrong,) = found["rows"]["masks"], found["rows"]["masks_poses"]
    assert row["idf1"] > 0.9 and row["ghosts"] == 0
    (track,) = row["tracks"]
    assert track["true"] == "bird" and track["frames"] > 10 and track["label"] is not None
    assert wrong["answers"]["true"]["tracks"] == 1 and set(wrong["answers"]) == {"true", "given", "found"}


@pytest.mark.long
def test_masks_that_are_found_and_given_are_classified(monkeypatch, tmp_path):
    data = ("preset=smoke", "only=[masks]", "dataset.frames=8", f"folder={tmp_path}/data")
    run_command(measure_tracking, monkeypatch, *data, f"hydra.run.dir={tmp_path}/made")
    asked = (f"captures=[{tmp_path}/data/test]", "labels=true", "only=['field_*']", f"hydra.run.dir={tmp_path}/run")
    run_command(measure_segmentation, monkeypatch, *asked)
    found = results(tmp_path / "run")
    assert found["labels"]["captures"] == found["labels"]["labelled_given"] == len(found["rows"]) == 1
    assert found["rows"][0]["true"] == "bird" and found["rows"][0]["median_iou"] > 0.5
    kept = tmp_path / "run/rows.json"
    kept.write_text(json.dumps([{**found["rows"][0], "ghosts_in_100": 7.0}]))
    (tmp_path / "run/results.json").unlink()
    run_command(measure_segmentation, monkeypatch, *asked)
    assert results(tmp_path / "run")["rows"][0]["ghosts_in_100"] == 7.0  # a run that was stopped goes on
    for mask in tmp_path.glob("data/test/*/*/mask/*.png"):
        cv2.imwrite(str(mask), np.zeros_like(cv2.imread(str(mask), cv2.IMREAD_UNCHANGED)))
    run_command(measure_segmentation, monkeypatch, *asked, f"hydra.run.dir={tmp_path}/hidden")
    hidden = results(tmp_path / "hidden")
    assert hidden["labels"]["labelled_given"] == 0 and hidden["rows"][0]["median_iou"] is None
