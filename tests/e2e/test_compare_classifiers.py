"""The comparison of classifiers as one sweep: trained, examined, tabulated, and not done again when it is finished."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from support.clip_examples import random_clip
from support.command_line import run_command

from aerojax.core.types import CLASSES
from aerojax.data.clips import save_clip
from aerojax.evaluate.rotations import PROTOCOLS
from experiments import compare_classifiers


@pytest.fixture(scope="module")
def clips(tmp_path_factory) -> Path:
    """One rig's clips of random clouds, one identity a class and split."""
    folder = tmp_path_factory.mktemp("clips") / "rig"
    for index, split in enumerate(("train", "val", "test")):
        for label, name in enumerate(CLASSES):
            columns = np.asarray(random_clip(10 * index + label, time=4, tokens=32, anisotropy=0.2 * label))
            save_clip(folder / split / f"{name}.npz", columns, name, f"{name}_{split}")
    return folder


def compare(
    monkeypatch, folder: Path, clips: Path, *overrides: str, which=("classifier=E_C,E_X_last_frame", "seed=0")
) -> None:
    data = (f"clips=[{clips}]", "tests=[]", "also_test=[]", f"test.rotations={folder}/rotations", "variation.tokens=16")
    where = f"hydra.sweep.dir={folder}/sweep"
    run_command(compare_classifiers, monkeypatch, "-m", "preset=smoke", *which, where, *data, *overrides)


@pytest.mark.long
def test_a_sweep_leaves_a_table_and_goes_on_where_it_was_stopped(clips, monkeypatch, tmp_path, capsys):
    compare(monkeypatch, tmp_path, clips)
    sweep = tmp_path / "sweep"
    table = json.loads((sweep / "table.json").read_text())
    rows = {row["classifier"]: row for row in table["rows"]}
    assert list(rows) == ["E_C", "E_X_last_frame"] and table["runs"] == 2
    for name, row in rows.items():
        left = json.loads((sweep / f"{name}_seed0/comparison.json").read_text())
        assert row["seeds"] == [0] and left["figures"]["rotations"]["z"]["trials"]
        assert list(row["protocols"]) == [p.name for p in PROTOCOLS]
        # Exactly invariant: four clips are answered alike however they are turned.
        assert {figure["mean"] for figure in row["protocols"].values()} == {row["clip"]["mean"]}
        assert row["gain"]["mean"] == pytest.approx(row["clip"]["mean"] - row["last_frame"]["mean"])
    # A model that answers from the last frame says the same of that frame alone.
    assert rows["E_X_last_frame"]["gain"]["mean"] == 0
    page = (sweep / "table.md").read_text()
    assert page in capsys.readouterr().out and "| E_C | C |" in page and "z/SO3_pf" in page

    # One run was killed before its end: it alone is done again, from its weights, with the same figures.
    lost, kept = sweep / "E_C_seed0/comparison.json", sweep / "E_X_last_frame_seed0/comparison.json"
    before, stamp = json.loads(lost.read_text()), kept.stat().st_mtime_ns
    lost.unlink()
    compare(monkeypatch, tmp_path, clips)
    assert kept.stat().st_mtime_ns == stamp
    assert f"{kept.parent} is finished" in capsys.readouterr().out
    assert json.loads(lost.read_text()) == before
    assert json.loads((sweep / "table.json").read_text())["rows"] == table["rows"]

    with pytest.raises(SystemExit) as ended:
        compare(monkeypatch, tmp_path, clips, "training.batch=2")
    assert ended.value.code == 2
    assert "another configuration (training in run.json)" in capsys.readouterr().err


@pytest.mark.long
def test_steps_are_held_against_the_row_before(clips, monkeypatch, tmp_path, capsys):
    rows = ("rows=steps", "classifier=few_clips,more_clips", "seed=0,1")
    small = ("model.d_model=32", "model.mamba_layers=1", "model.depth=1", "variation.frames=4", "training.passes=2")
    chosen = ("selection.published=false", "selection.per_class=1", f"validation=[{clips}]")
    compare(monkeypatch, tmp_path, clips, *small, *chosen, which=rows)
    table = json.loads((tmp_path / "sweep/table.json").read_text())
    few, more = table["rows"]
    assert [few["classifier"], more["classifier"]] == ["few_clips", "more_clips"] and few["seeds"] == [0, 1]
    assert few["difference"] is None and more["against"] == "few_clips"
    assert few["steps"] == 2 and few["training_clips"] == few["training_identities"] == 4
    for row in (few, more):
        alone, together = row["tests"], row["averaged"]
        assert set(alone) == set(together["tests"]) == {"all", "rig", "val"} and together["networks"] == 2
        assert alone["all"]["accuracy"] == alone["rig"]["accuracy"] and alone["all"]["clips"] == 4
    gap = more["tests"]["all"]["accuracy"]["mean"] - few["tests"]["all"]["accuracy"]["mean"]
    assert more["difference"]["accuracy"] == pytest.approx(gap)
    page = (tmp_path / "sweep/table.md").read_text()
    assert page in capsys.readouterr().out and "| more_clips | 1,200 clips of the same individuals | 4 of 4 |" in page


@pytest.mark.long
def test_studies_are_held_against_the_whole(clips, monkeypatch, tmp_path):
    rows = ("rows=studies", "classifier=E_X,without_mamba", "seed=0")
    small = ("model.d_model=32", "model.mamba_layers=1", "model.depth=1", "variation.frames=4")
    compare(monkeypatch, tmp_path, clips, *small, f"validation=[{clips}]", which=rows)
    table = json.loads((tmp_path / "sweep/table.json").read_text())
    whole, less = table["rows"]
    assert [whole["classifier"], less["classifier"]] == ["E_X", "without_mamba"] and whole["difference"] is None
    gap = less["tests"]["all"]["accuracy"]["mean"] - whole["tests"]["all"]["accuracy"]["mean"]
    assert less["difference"]["accuracy"] == pytest.approx(gap) and less["change"].startswith("a mean over the frames")
    assert (tmp_path / "sweep/table.svg").read_text().startswith("<svg")


@pytest.mark.long
def test_other_networks_are_turned_and_read_whole(clips, monkeypatch, tmp_path):
    rows = ("rows=baselines", "classifier=p4transformer_so3,vn_pointnet", "seed=0")
    compare(monkeypatch, tmp_path, clips, "variation.frames=4", which=rows)
    table = json.loads((tmp_path / "sweep/table.json").read_text())
    found = {row["classifier"]: row for row in table["rows"]}
    assert found["p4transformer_so3"]["trained"] == "so3" and found["p4transformer_so3"]["member"] == "p4transformer"
    invariant = found["vn_pointnet"]["turned"]
    assert len({figure["mean"] for figure in invariant.values()}) == 1
    assert found["vn_pointnet"]["tests"]["rig"]["clips"] == 4 and found["vn_pointnet"]["difference"] is None
    assert "| vn_pointnet | VN-PointNet, small |" in (tmp_path / "sweep/table.md").read_text()
