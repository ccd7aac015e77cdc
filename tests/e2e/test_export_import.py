"""From the simulator to other tools and back: both acts as a user starts them."""

from __future__ import annotations

import json

import numpy as np
import pytest
from command_line import run_command

from aerojax.capture.format import read_capture
from aerojax.capture.images import read_mask
from aerojax.simulate.assets.catalogue import identities
from aerojax.simulate.dataset import SequenceConfig, simulate_sequence
from aerojax.simulate.rigs import RigConfig
from experiments import export_dataset, import_replicator


@pytest.fixture(scope="module")
def simulated(tmp_path_factory):
    """A folder of two simulated sequences of different classes."""
    folder = tmp_path_factory.mktemp("simulated")
    rig = RigConfig(kind="circle", cameras=3, width=320, height=240)
    config = SequenceConfig(rigs=(rig,), frames=3, samples=1)
    chosen = {identity.label: identity for identity in identities("val", 1)}
    for label in ("bird", "drone"):
        simulate_sequence(chosen[label], config, seed=7, folder=folder / "set/val" / label, assets=folder / "assets")
    return folder


def test_export_and_import(simulated, tmp_path, monkeypatch):
    folder, run = tmp_path / "out", f"hydra.run.dir={tmp_path}/run"
    given = (f"dataset={simulated}/set", f"out={folder}", "images=hardlink", run)
    run_command(export_dataset, monkeypatch, *given, "format=[coco,replicator]")
    assert json.loads((tmp_path / "run/metrics.json").read_text())["sequences"] == 2
    coco = json.loads((folder / "coco/annotations/instances_val.json").read_text())
    assert len(coco["images"]) == 18 and {a["category_id"] for a in coco["annotations"]} == {1, 2}

    recording, back = f"recording={folder}/replicator/val/drone", tmp_path / "back"
    run_command(import_replicator, monkeypatch, recording, f"out={back}", "fps=30", run)
    before, after = read_capture(simulated / "set/val/drone"), read_capture(back)
    for index in range(3):
        np.testing.assert_array_equal(read_mask(after, index, 2), read_mask(before, index, 2))
    # A body of 1 m: the visible surface's mean lies within half of that of its origin.
    one, other = before.truth.objects[0].frames[2], after.truth.objects[0].frames[2]
    assert np.linalg.norm(np.subtract(one.position, other.position)) < 0.5


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ("format=kitti", "unknown format 'kitti'"),
        ("images=move", "images"),
        ("dataset=/nowhere", "holds no capture.json"),
        ("workers=0", "workers=0"),
    ],
)
def test_mistakes_end_with_a_word(simulated, tmp_path, monkeypatch, capsys, change, named):
    given = [f"dataset={simulated}/set", "format=yolo", f"out={tmp_path}/out", f"hydra.run.dir={tmp_path}/run"]
    given = [item for item in given if item.split("=")[0] != change.split("=")[0]]
    with pytest.raises(SystemExit) as ended:
        run_command(export_dataset, monkeypatch, *given, change)
    assert ended.value.code == 2 and named in capsys.readouterr().err
    assert not (tmp_path / "out/yolo").exists()
