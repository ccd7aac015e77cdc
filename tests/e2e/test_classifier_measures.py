"""`eval_rotation` and `measure_drift` at their smallest, on random clips and an untrained classifier."""

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
from experiments import eval_rotation, measure_drift


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
    assert found["exactly_invariant"] and found["trained"] == "none" and found["model"] == str(weights)
    for kind in ("z", "so3"):
        assert found["rotations"][kind]["answers_changed"] == 0
        assert found["paired_95"][kind] == {"difference": 0.0, "low": 0.0, "high": 0.0}
    assert [row["frames"] for row in found["prefix_accuracy"]] == [1, 2, 3, 4]
    assert found["windows"] == found["videos"] == found["identities"] == 4


@pytest.mark.slow
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
