"""Every experiment at its smallest, one after the other: clips, training, classification."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest
from support.command_line import run_command

from aerojax.classify.load import load_classifier
from aerojax.core.types import CLASSES
from aerojax.data.clips import load_clips
from aerojax.evaluate.answers import log_probabilities
from experiments import classify, generate_dataset, reconstruct_dataset, train_classifier, train_detector


@pytest.fixture(scope="module")
def place(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("smoke")


@pytest.fixture(scope="module")
def monkeymodule():
    with pytest.MonkeyPatch.context() as patch:
        yield patch


@pytest.fixture(scope="module")
def clips(place, monkeymodule) -> Path:
    """The folder of one rig's clips, reconstructed from a data set that was generated for it."""
    splits = "sequences={train: 1, val: 1, test: 1}"
    where = (f"folder={place}/data", f"hydra.run.dir={place}/generate")
    run_command(generate_dataset, monkeymodule, "preset=smoke", "rig=random", splits, "frames=4", *where)
    _reconstruct(place, monkeymodule)
    return place / "clips" / "random"


def _reconstruct(place: Path, patch: pytest.MonkeyPatch) -> None:
    where = (f"datasets=[{place}/data]", f"folder={place}/clips", f"hydra.run.dir={place}/reconstruct")
    run_command(reconstruct_dataset, patch, "preset=smoke", "workers=1", *where)


@pytest.fixture(scope="module")
def trained(place, clips, monkeymodule) -> Path:
    """The run directory of `train_classifier` on those clips."""
    where = (f"clips=[{clips}]", "tests=[]", "also_test=[]", f"hydra.run.dir={place}/train")
    run_command(train_classifier, monkeymodule, "preset=smoke", *where)
    return place / "train"


@pytest.mark.slow
def test_clips_are_made_whole(clips, place):
    counted = json.loads((place / "reconstruct/metrics.json").read_text())["clips"]
    assert counted == {f"random/{split}": 4 for split in ("train", "val", "test")}
    for split in ("train", "val", "test"):
        made = load_clips(clips / split, frames=4)
        assert sorted(made.label.tolist()) == [0, 1, 2, 3]
        assert made.columns.shape[1:] == (4, 512, 14) and made.present.any(axis=1).all()
        assert np.isfinite(made.columns).all()
        real = made.columns[made.present]
        assert (real[..., 7:10] > 0).all() and ((real[..., 10] > 0) & (real[..., 10] <= 1)).all()
        np.testing.assert_allclose(np.linalg.norm(real[..., 3:7], axis=-1), 1.0, atol=1e-5)
        # One metre across, wherever it flies.
        spread = np.linalg.norm(real[..., :3] - real[..., :3].mean(axis=1, keepdims=True), axis=-1).max(axis=1)
        assert 0.3 < np.median(spread) < 0.9


@pytest.mark.slow
def test_a_clip_that_is_lost_is_made_again_with_the_same_bytes(clips, place, monkeypatch):
    lost = sorted((clips / "val").glob("*.npz"))[0]
    before, others = np.load(lost), {p: p.stat().st_mtime_ns for p in clips.glob("*/*.npz") if p != lost}
    columns = before["columns"]
    lost.unlink()
    _reconstruct(place, monkeypatch)
    np.testing.assert_array_equal(np.load(lost)["columns"], columns)
    assert {p: p.stat().st_mtime_ns for p in others} == others


@pytest.mark.slow
def test_training_writes_weights_that_read_back(trained, clips):
    results = json.loads((trained / "metrics.json").read_text())
    assert results["clips"] == [str(clips)] and results["test"]["clips"] == 4
    assert len((trained / "history.jsonl").read_text().splitlines()) == 1
    classifier = load_classifier(trained / "weights.safetensors")
    card = classifier.card
    assert (card.tokens, card.frames, card.rotation, card.token_ensembles) == (32, 4, "none", 4)
    assert dict(card.settings)["crop_size"] and json.loads(card.record)["seed"] == 0
    test = load_clips(clips / "test", frames=4)
    again = log_probabilities(classifier, test)
    nll = -again[np.arange(4), test.label].mean()
    assert nll == pytest.approx(results["test"]["nll"], rel=1e-4)
    assert bool(jnp.isfinite(jnp.asarray(again)).all())


@pytest.mark.slow
def test_the_sample_is_classified_with_those_weights(trained, place, monkeypatch, capsys):
    where = (f"sample.folder={place}/samples", f"assets={place}/assets", f"hydra.run.dir={place}/classify")
    run_command(classify, monkeypatch, "preset=smoke", "explain=true", f"weights={trained}/weights.safetensors", *where)
    result = json.loads((place / "classify/result.json").read_text())
    assert set(result["probabilities"]) == set(CLASSES)
    assert result["most_likely"] == max(result["probabilities"], key=result["probabilities"].get)
    assert (result["label"] is None) == (result["status"] != "ok") == bool(result["reasons"])
    assert len(result["frames"]) + len(result["dropped"]) == 4
    truth = json.loads((Path(result["capture"]) / "truth.json").read_text())["objects"][0]["frames"]
    for row in result["track"]:
        assert np.linalg.norm(np.array(row["position"]) - truth[row["frame"]]["position"]) < 0.3
    explained = json.loads((place / "classify/explanation.json").read_text())
    assert len(explained["frames"]) == len(result["frames"]) and explained["label"] in range(len(CLASSES))
    page = (place / "classify/report.html").read_text()
    assert "Frames that it stands on" in page
    assert "<html" in page and "http://" not in page.replace("http://www.w3.org", "")
    assert "truth: drone" in capsys.readouterr().out
    shutil.rmtree(place / "samples")


@pytest.mark.slow
def test_a_detector_is_trained_on_its_images_and_asked_again(clips, place, monkeypatch):
    data = ("preset=smoke", f"dataset={place}/data")
    run_command(train_detector, monkeypatch, *data, "detector.frames=2", f"hydra.run.dir={place}/detector")
    weights = f"weights={place}/detector/weights.safetensors"
    run_command(train_detector, monkeypatch, *data, weights, f"hydra.run.dir={place}/asked")
    first, again = (json.loads((place / name / "metrics.json").read_text()) for name in ("detector", "asked"))
    assert first["test"]["clips"] == 4 and set(first["groups"]["rigs"]) == {"random"}
    assert first["images"]["count"] == 4 and again["detector"]["frames"] == 2
    assert (again["test"], again["images"]) == (first["test"], first["images"])
