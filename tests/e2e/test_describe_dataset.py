"""A small generated data set is described: every disagreement explained, nothing leaks; spoilt files are noticed."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from support.command_line import run_command

from aerojax.data.manifest import read_datasets
from aerojax.evaluate.dataset_qa.consistency import consistency
from aerojax.evaluate.dataset_qa.observations import Observations, joined, observe_sequence
from experiments import describe_dataset, generate_dataset

pytestmark = pytest.mark.slow
SMALL = ("rig=sim1", "preset=smoke", "classes=[bird]", "frames=2", "images.normals=false", "images.flow=false")
SIZE = ("rig.fixed.width=640", "rig.fixed.height=360", "rig.fixed.focal_px=1400.0", "radii=[4,32]")
IMAGES = 2 * 2 * 2 * 2 * 4  # splits, radii, elevations, frames, cameras


@pytest.fixture(scope="module")
def dataset(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("described")
    with pytest.MonkeyPatch.context() as patch:
        where = (f"folder={folder}/data", f"hydra.run.dir={folder}/generate", "workers=1")
        run_command(generate_dataset, patch, *SMALL, *SIZE, *where)
    return folder / "data"


def observed(dataset: Path) -> Observations:
    entries = read_datasets([dataset])
    return joined([observe_sequence(entry, i, depth=True) for i, entry in enumerate(entries.sequences)])


def test_everything_is_written(dataset, monkeypatch, capsys):
    out = dataset.parent / "described"
    where = (f"dataset={dataset}", f"hydra.run.dir={out}", "workers=1")
    run_command(describe_dataset, monkeypatch, "preset=smoke", *where)
    found = json.loads((out / "description.json").read_text())
    train, test = found["compositions"]
    assert (train["identities"], train["sequences"], train["frames"]) == (1, 4, 8)
    assert test["frames_by_class"] == [8, 0, 0, 0] and test["gini"] == 0.0
    row = found["consistency"][0]
    assert row["views"] == IMAGES and row["missed"] == 0 and row["at_rest"] == 8
    assert row["iou"]["median"] > 0.95 and row["iou"]["p5"] > 0.5
    assert row["residual_depth"]["p95"] < 0.5  # without the perspective
    assert [row[key][-1]["views"] for key in ("box_causes", "residual_causes")] == [0, 0]
    assert sum(map(sum, found["coverage"][0]["areas"])) == IMAGES
    assert found["coverage"][0]["visibility"] == [1.0, 1.0, 1.0, 1.0]
    assert {m["identity"] for m in found["motions"]} == {i["name"] for i in manifest(dataset)["identities"]}
    bird = next(m for m in found["class_motions"] if m["label"] == "bird")
    assert max(bird["mean"]) > 0.01  # wings beat by centimetres
    assert found["leakage"]["copies"] == found["leakage"]["shared_files"] == []
    page = (out / "description.html").read_text()
    assert "Consistency of annotations" in page and "://" not in page and "<script" not in page
    assert "| sim1 | train | 1 | 4 | 8 |" in (out / "description.md").read_text()
    assert len(list((out / "figures").glob("*.svg"))) == 5 and len(list((out / "figures").glob("*.png"))) == 4
    assert "Leakage: none" in capsys.readouterr().out


def manifest(dataset: Path) -> dict:
    return json.loads((dataset / "dataset.json").read_text())


def test_a_shifted_mask_and_a_lost_object_are_noticed(dataset, tmp_path):
    spoilt = tmp_path / "spoilt"
    shutil.copytree(dataset, spoilt)
    far = [s for s in manifest(spoilt)["sequences"] if s["radius_m"] == 32.0 and s["class"] == "bird"]
    shifted, lost = (s["folder"] for s in far[:2])
    for kind in ("mask", "coverage"):
        path = spoilt / shifted / "cam_01" / kind / "000000.png"
        picture = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        cv2.imwrite(str(path), np.roll(picture, 9, axis=1))
        path = spoilt / lost / "cam_02" / kind / "000001.png"
        picture = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        cv2.imwrite(str(path), np.zeros_like(picture))
    row = consistency("sim1", observed(spoilt))
    assert row.missed == 1
    assert row.box_causes[-1].views == 1 and row.residual_causes[-1].views == 1
    assert consistency("sim1", observed(dataset)).missed == 0


def test_an_identity_in_two_splits_is_noticed(dataset, tmp_path, monkeypatch, capsys):
    spoilt = tmp_path / "spoilt"
    shutil.copytree(dataset, spoilt)
    birds = {i["split"]: i for i in manifest(spoilt)["identities"] if i["class"] == "bird"}
    shutil.copyfile(spoilt / birds["train"]["asset"], spoilt / birds["test"]["asset"])
    picture = Path(birds["train"]["asset"]).with_suffix(".png").name
    assert (spoilt / "assets" / picture).is_file()
    where = (f"dataset={spoilt}", f"hydra.run.dir={tmp_path}/described", "workers=1", "every=4", "depth=false")
    run_command(describe_dataset, monkeypatch, "preset=smoke", *where)
    found = json.loads((tmp_path / "described/description.json").read_text())["leakage"]
    assert found["shared_files"] == [sorted(bird["name"] for bird in birds.values())]
    assert [n["nearest"] for n in found["copies"]] == [birds["train"]["name"]]
    assert "FAILED: files are disjoint, no held-out shape is a copy" in capsys.readouterr().out
