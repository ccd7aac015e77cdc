"""The shipped classifier on captures that another renderer made from third-party models."""

from __future__ import annotations

import json
from dataclasses import replace

import jax
import numpy as np
import pytest
from support.command_line import run_command

from aerojax.capture.format import read_capture
from aerojax.classify.load import load_classifier
from aerojax.core.types import CLASSES
from aerojax.evaluate.labels import confusion_matrix
from aerojax.pipeline.config import PipelineConfig
from aerojax.pipeline.offline import reconstruct_capture
from experiments import classify

FRAMES = 12  # of 24: half the time, and about the length that training saw
NEEDED = 8  # of 8 captures


@pytest.fixture
def captures(shared):
    folders = sorted(p.parent for p in (shared / "data/captures").glob("*/capture.json"))
    if not folders:
        pytest.skip(f"no captures in {shared / 'data/captures'}")
    return [read_capture(folder) for folder in folders]


@pytest.mark.slow
def test_most_reference_captures_are_told_right(captures, tmp_path):
    classifier = load_classifier()
    truths, guesses, rows = [], [], {}
    for capture in captures:
        shorter = replace(capture, frames=FRAMES)
        clip = reconstruct_capture(shorter, PipelineConfig(), classifier, key=jax.random.key(0))
        answer = np.exp(clip.log_probabilities[-1])
        assert answer.sum() == pytest.approx(1.0, abs=1e-5)
        truths.append(CLASSES.index(capture.truth.objects[0].class_name))
        guesses.append(int(np.argmax(answer)))
        rows[capture.folder.name] = {
            "probabilities": dict(zip(CLASSES, answer.tolist(), strict=True)),
            "right": truths[-1] == guesses[-1],
            "frames": len(clip.frames),
        }
    confusion = confusion_matrix(np.array(guesses), np.array(truths), len(CLASSES))
    report = {"classes": CLASSES, "confusion": confusion.tolist(), "captures": rows}
    (tmp_path / "shared_captures.json").write_text(json.dumps(report, indent=1))
    print(json.dumps(report, indent=1))
    assert int(np.trace(confusion)) >= NEEDED


def test_the_command_writes_result_and_report(captures, tmp_path, monkeypatch, capsys):
    capture = captures[0]
    arguments = [f"capture={capture.folder}", "preset=smoke", f"hydra.run.dir={tmp_path}/run"]
    run_command(classify, monkeypatch, *arguments)
    result = json.loads((tmp_path / "run/result.json").read_text())
    assert result["status"] == "ok" and result["reasons"] == []
    assert result["label"] == result["most_likely"] in CLASSES and sum(
        result["probabilities"].values()
    ) == pytest.approx(1.0, abs=1e-5)
    assert len(result["track"]) == len(result["frames"]) <= capture.frames
    truth = np.array([state.position for state in capture.truth.objects[0].frames])[result["frames"]]
    track = np.array([row["position"] for row in result["track"]])
    assert np.median(np.linalg.norm(track - truth, axis=1)) < 0.15  # metres; the object measures one
    page = (tmp_path / "run/report.html").read_text()
    assert "<html" in page and 500_000 < len(page.encode()) <= 2_000_000
    assert result["label"] in capsys.readouterr().out
