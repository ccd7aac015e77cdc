"""Things of none of the classes: a ball and a box end to end, and the acts that fit and measure, at their smallest."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import jax
import numpy as np
import pytest
from support.clip_examples import random_clip
from support.command_line import run_command
from support.crop_examples import random_crops

from aerojax.classify.base import untrained
from aerojax.classify.familiarity import load_familiarity
from aerojax.classify.load import save_classifier
from aerojax.classify.views.config import ViewsConfig
from aerojax.core.types import CLASSES, UNKNOWN
from aerojax.data.clips import crop_bytes, save_clip
from experiments import classify, fit_familiarity, measure_unknown

TIME = 3


def classified(monkeypatch, place: Path, label: str) -> dict[str, Any]:
    where = (f"sample.folder={place}/samples", f"assets={place}/assets", f"hydra.run.dir={place}/run")
    run_command(classify, monkeypatch, f"sample.label={label}", *where)
    return json.loads((place / "run/result.json").read_text())


@pytest.mark.long
@pytest.mark.parametrize("kind", ["ball", "box"])
def test_a_ball_and_a_box_are_unknown(kind, monkeypatch, tmp_path, capsys):
    result = classified(monkeypatch, tmp_path, kind)
    assert (result["version"], result["status"], result["label"]) == (2, "ok", UNKNOWN)
    assert result["familiarity"] < 0.05 and [reason["code"] for reason in result["reasons"]] == ["unfamiliar"]
    said = " ".join(capsys.readouterr().out.split())
    assert "unknown: like none of the classes" in said and "truth: unknown, right" in said
    page = (tmp_path / "run/report.html").read_text()
    assert '<h1 class="label">unknown</h1>' in page and "like none of the classes" in page


@pytest.mark.long
def test_a_drone_that_was_never_seen_is_still_one(monkeypatch, tmp_path):
    result = classified(monkeypatch, tmp_path, "drone")
    assert (result["status"], result["label"], result["reasons"]) == ("ok", "drone", [])
    assert result["familiarity"] >= 0.05


def save(path: Path, seed: int, label: str, classes: tuple[str, ...], **facts: str) -> None:
    crops = random_crops(seed, time=TIME, views=3)
    images = {"crops": crop_bytes(np.asarray(crops.rgba)), "crop_valid": np.asarray(crops.valid)}
    save_clip(
        path,
        np.asarray(random_clip(seed, time=TIME, tokens=4)),
        label,
        path.stem,
        facts=facts,
        classes=classes,
        **images,
    )


@pytest.mark.long
def test_a_familiarity_is_fitted_and_measured(monkeypatch, tmp_path, capsys):
    rig, weights = tmp_path / "rig", tmp_path / "weights.safetensors"
    for number, split in enumerate(("train", "val", "test")):
        for label, name in enumerate(CLASSES):
            for copy in range(2):
                save(rig / split / f"{name}_{copy}.npz", 20 * number + 2 * label + copy, name, CLASSES)
    for number, split in enumerate(("val", "test")):
        save(rig / f"outliers_{split}" / "disc_0.npz", 90 + number, UNKNOWN, (UNKNOWN,), kind="disc")
    config = ViewsConfig(width=8, hidden=8, view_width=8, d_model=16, layers=1)
    save_classifier(weights, untrained(config, tokens=4, frames=TIME, key=jax.random.key(0)))
    given = (f"weights={weights}", f"clips=[{rig}]", "frames=3", "draws=10")
    run_command(fit_familiarity, monkeypatch, *given, f"hydra.run.dir={tmp_path}/fit")
    found = json.loads((tmp_path / "fit/metrics.json").read_text())
    assert (found["training_clips"], found["validation_clips"], found["validation_families"]) == (8, 8, 4)
    assert 0 <= found["validation"]["auroc"] <= 1 and found["validation"]["outliers"] == {"disc": 1}
    page = (tmp_path / "weights.familiarity.md").read_text()
    assert "# Familiarity of views, coverage" in page and "| disc | " in page and "8 validation clips" in page
    familiarity = load_familiarity(weights)
    assert familiarity is not None and familiarity.known.shape == (3, 8) and familiarity.mean.shape == (2, 4, 16)
    run_command(measure_unknown, monkeypatch, *given, "also=[]", f"hydra.run.dir={tmp_path}/measure")
    result = json.loads((tmp_path / "measure/results.json").read_text())
    assert result["all"]["clips"] == 8 and result["outliers"] == {"disc": 1}
    assert set(result["all"]["alarms"]) == {"class", "plain", "with_unknown"} and 0 <= result["all"]["ece"] <= 1
    sets = result["all"]["sets"]  # of four families nine tenths cannot be said, so that sets hold everything
    assert (sets["stated"], sets["coverage"], sets["mean_size"], sets["families"]) == (0.9, 1.0, 4.0, 4)
    assert "disc: " in capsys.readouterr().out
