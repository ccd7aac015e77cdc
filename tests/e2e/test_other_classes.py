"""Clips of another data set's classes, from the act that makes them to a trained card and its rotation protocols."""

from __future__ import annotations

import json

import numpy as np
import pytest
from support.command_line import run_command

from aerojax.classify.load import load_classifier
from aerojax.simulate.assets.shapes.kinds import SHAPES_10
from experiments import eval_rotation, generate_shapes, train_classifier


@pytest.mark.long
def test_a_classifier_learns_shapes_10(monkeypatch, tmp_path):
    shapes, run, turned = (tmp_path / name for name in ("shapes", "run", "turned"))
    where = (f"folder={shapes}", f"hydra.run.dir={tmp_path}/made")
    run_command(generate_shapes, monkeypatch, "preset=smoke", *where, "per_class={train: 6, val: 1, test: 2}")
    small = [f"model.{n}" for n in ("token_features=8", "token_invariants=8", "channels=4", "heads=2", "head_dim=2")]
    clips = (f"clips=[{shapes}]", "tests=[]", "also_test=[]", "frames=2", "variation.frames=1", "variation.shift=0.2")
    rhythm = ("training.batch=20", "training.epochs=6", "training.optimiser.learning_rate=1e-2", "training.average=0")
    run_command(
        *(train_classifier, monkeypatch, "preset=smoke", "classify=mambasplat", f"hydra.run.dir={run}"),
        *(*clips, *small, *rhythm),
    )
    metrics = json.loads((run / "metrics.json").read_text())
    losses = [json.loads(line)["loss"] for line in (run / "history.jsonl").read_text().splitlines()]
    assert tuple(metrics["classes"]) == SHAPES_10 and metrics["trained"]["model"]["classes"] == 10
    assert np.array(metrics["test"]["confusion"]).shape == (10, 10) and losses[-1] < losses[0]
    classifier = load_classifier(run / "weights.safetensors")
    assert classifier.card.classes == SHAPES_10
    run_command(
        *(eval_rotation, monkeypatch, "preset=smoke", f"model={run}/weights.safetensors", f"clips=[{shapes}]"),
        *(f"hydra.run.dir={turned}", f"rotations={turned}/rotations", "frames=1", "trials=1", "draws=10"),
    )
    results = json.loads((turned / "results.json").read_text())
    assert tuple(results["classes"]) == SHAPES_10 and len(results["rotations"]["so3"]["trials"]) == 1
