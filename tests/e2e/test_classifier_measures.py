"""Acts that measure a classifier at their smallest, on random clips and an untrained classifier."""

from __future__ import annotations

import json
from pathlib import Path

import jax
import numpy as np
import pytest
from support.clip_examples import random_clip
from support.command_line import run_command

from aerojax.classify.base import untrained
from aerojax.classify.load import save_classifier
from aerojax.classify.mambasplat.config import MambaSplatConfig
from aerojax.core.types import CLASSES
from aerojax.data.clips import save_clip
from experiments import eval_rotation, measure_accuracy, measure_cost, measure_drift, measure_frames, measure_robustness


@pytest.fixture(scope="module")
def place(tmp_path_factory) -> Path:
    """Clips of one rig, one identity a class and split, and weights."""
    folder = tmp_path_factory.mktemp("measures")
    for index, split in enumerate(("val", "test")):
        for label, name in enumerate(CLASSES):
            columns = np.asarray(random_clip(10 * index + label, time=4, tokens=32))
            save_clip(folder / "rig" / split / f"{name}.npz", columns, name, f"{name}_{split}")
    config = MambaSplatConfig(depth=1, mamba_layers=1, d_model=16, channels=4)
    save_classifier(folder / "weights.safetensors", untrained(config, tokens=32, frames=4, key=jax.random.key(0)))
    return folder


@pytest.mark.slow
def test_rotations_do_not_change_what_an_invariant_classifier_answers(place, monkeypatch):
    where = (f"clips=[{place}/rig]", f"rotations={place}/rotations", f"hydra.run.dir={place}/rotation")
    weights = place / "weights.safetensors"
    run_command(eval_rotation, monkeypatch, "preset=smoke", f"model={weights}", f"against={weights}", *where)
    found = json.loads((place / "rotation/results.json").read_text())
    assert (
        found["exactly_invariant"]
        and found["note"].startswith("exactly invariant")
        and found["trained"] == "none"
        and found["model"] == str(weights)
    )
    for kind in ("z", "so3"):
        assert found["rotations"][kind]["answers_changed"] == 0
        assert found["paired_95"][kind] == {"difference": 0.0, "low": 0.0, "high": 0.0}
    assert [row["frames"] for row in found["prefix_accuracy"]] == [1, 2, 3, 4]
    assert found["windows"] == found["videos"] == found["identities"] == 4
    assert found["temperature"] > 0 and found["rotations"]["z"]["trials"][0]["clip"]["ece_with_temperature"] >= 0


@pytest.mark.slow
def test_without_validation_clips_there_is_no_temperature(place, monkeypatch, capsys):
    (place / "alone").mkdir()
    (place / "alone/test").symlink_to(place / "rig/test")
    where = (f"clips=[{place}/alone]", f"rotations={place}/rotations", f"hydra.run.dir={place}/without")
    run_command(eval_rotation, monkeypatch, "preset=smoke", f"model={place}/weights.safetensors", *where)
    found = json.loads((place / "without/results.json").read_text())
    assert found["temperature"] is None
    assert found["rotations"]["so3"]["trials"][0]["video"]["ece_with_temperature"] is None
    assert "z/SO3" in capsys.readouterr().out


@pytest.mark.long
def test_drift_of_a_file_and_of_an_untrained_model(place, monkeypatch, capsys):
    weights = place / "weights.safetensors"
    where = (f"clips=[{place}/rig]", f"hydra.run.dir={place}/drift")
    run_command(measure_drift, monkeypatch, "preset=smoke", f"model=[{weights}]", "mode=[C]", "double=1", *where)
    models = json.loads((place / "drift/results.json").read_text())["models"]
    assert set(models) == {str(weights), "untrained C 0"}
    for row in models.values():
        assert row["variant"] == "exact" and row["rotation"]["largest_drift"] < 1e-4
        assert row["rotation_double"]["largest_drift"] < 1e-10
    assert "drift/results.json" in capsys.readouterr().out


@pytest.mark.slow
def test_accuracy_of_folders(place, monkeypatch, capsys):
    where = (f"tests=[{place}/rig]", "also=[]", f"hydra.run.dir={place}/accuracy")
    run_command(measure_accuracy, monkeypatch, "preset=smoke", f"weights={place}/weights.safetensors", *where)
    found = json.loads((place / "accuracy/results.json").read_text())
    assert found["all"] == found["folders"][f"{place}/rig"] == found["rigs"]["rig"]
    assert (found["all"]["clips"], found["all"]["identities"], found["all"]["missing"]) == (4, 4, 0)
    assert found["width_px"] == [] and found["command"].startswith("python -m experiments.measure_accuracy")
    assert "accuracy/results.json" in capsys.readouterr().out


@pytest.mark.slow
def test_frames_in_order_and_shuffled(place, monkeypatch, capsys):
    where = (f"tests=[{place}/rig]", f"hydra.run.dir={place}/frames")
    run_command(measure_frames, monkeypatch, "preset=smoke", f"models=[{place}/weights.safetensors]", *where)
    (model,) = json.loads((place / "frames/results.json").read_text())["models"]
    assert model["name"] == "weights" and model["clips"] == 4 and len(model["whole"]) == 5
    assert model["fall"] is None and model["distance_m"] == [] and model["frames_by_distance"] == []
    assert (place / "frames/weights_frames.svg").read_text().startswith("<svg")
    assert "shuffled costs" in capsys.readouterr().out


@pytest.mark.long
def test_cost_of_members_and_modes(place, monkeypatch):
    weights = place / "weights.safetensors"
    run_command(measure_cost, monkeypatch, "preset=smoke", f"weights=[{weights}]", f"hydra.run.dir={place}/cost")
    found = json.loads((place / "cost/results.json").read_text())
    assert [row["name"] for row in found["members"]] == ["shipped", str(weights), "untrained views"]
    assert found["members"][0]["accuracy"] > 0.5 and found["members"][1]["accuracy"] is None
    assert [row["mode"] for row in found["rows"]] == ["C"] and found["rows"][0]["latency_ms"] > 0


@pytest.mark.slow
def test_robustness_goes_on_with_its_clips(place, monkeypatch, capsys):
    few = ("factory.pipeline.crop_size=64", "curves.calibration_deg=[0]", "curves.width_px=[]", "curves.cameras=[3]")
    fewer = ("curves.clock_ms=[]", "curves.mask_growth=[-90]", "curves.combined=[]", "workers=1")
    where = (f"weights={place}/weights.safetensors", f"folder={place}/levels", f"hydra.run.dir={place}/robustness")
    run_command(measure_robustness, monkeypatch, "preset=smoke", *few, *fewer, *where)
    found = json.loads((place / "robustness/results.json").read_text())
    rows = {(row["factor"], row["value"]): row for row in found["rows"]}
    assert set(rows) == {("ideal", 0.0), ("calibration_deg", 0.0), ("mask_growth", -90.0), ("cameras", 3.0)}
    assert rows["mask_growth", -90.0]["undrawn"] == 1.0 and rows["mask_growth", -90.0]["accuracy"] == 0.0
    assert rows["calibration_deg", 0.0]["difference"] == 0.0 and rows["ideal", 0.0]["clips"] == 4
    assert "| mask dilated" in (place / "robustness/table.md").read_text()
    assert (place / "robustness/curves.svg").read_text().startswith("<svg")
    times = {path: path.stat().st_mtime_ns for path in (place / "levels").rglob("*.npz")}
    run_command(measure_robustness, monkeypatch, "preset=smoke", *few, *fewer, *where)
    assert {path: path.stat().st_mtime_ns for path in (place / "levels").rglob("*.npz")} == times
