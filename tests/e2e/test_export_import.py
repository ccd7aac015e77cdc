"""From the simulator to other tools and back: both acts as a user starts them."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from support.command_line import run_command

from aerojax.capture.format import read_capture
from aerojax.capture.frames import read_depth, read_mask
from aerojax.simulate.assets.catalogue import identities
from aerojax.simulate.plan.planner import SequenceConfig, plan_sample
from aerojax.simulate.plan.scene import flying_object, image_patterns
from aerojax.simulate.record import record_scene
from aerojax.simulate.render.image import ImageConfig
from aerojax.simulate.sample import simulate_sequence
from aerojax.simulate.world.flight import Flight
from aerojax.simulate.world.random_rigs import RandomRigConfig
from experiments import export_dataset, import_replicator

CONFIG = SequenceConfig(rigs=(RandomRigConfig(kind="circle", cameras=3, width=320, height=240),), frames=3, samples=1)


@pytest.fixture(scope="module")
def simulated(tmp_path_factory):
    """Two simulated sequences: one drone; a bird with a helicopter that leaves, with all that a capture may hold."""
    folder = tmp_path_factory.mktemp("simulated")
    chosen = {identity.label: identity for identity in identities("val", 1)}
    assets = folder / "assets"
    simulate_sequence(chosen["drone"], CONFIG, seed=7, folder=folder / "set/val/drone", assets=assets)
    plan = plan_sample(chosen["bird"], CONFIG, seed=7, assets=assets)
    flight, away = plan.objects[0].flight, np.linspace([0.5, 0.0, 0.3], [12.0, 0.0, 9.0], CONFIG.frames)
    objects = (
        flying_object(chosen["bird"], assets, flight, 0.0),
        flying_object(chosen["helicopter"], assets, _moved(flight, away), 0.0),
    )
    images = ImageConfig(samples=1, normals=True)
    cameras = tuple(image_patterns(camera, images) for camera in plan.cameras)
    record_scene(
        replace(plan, objects=objects, cameras=cameras, calibration=cameras, images=images), folder / "set/val/pair"
    )
    return folder


def _moved(flight, shift):
    return Flight(flight.position + shift, flight.world_from_body)


def test_export_and_import(simulated, tmp_path, monkeypatch):
    folder, run = tmp_path / "out", f"hydra.run.dir={tmp_path}/run"
    given = (f"dataset={simulated}/set", f"out={folder}", "images=hardlink", run)
    run_command(export_dataset, monkeypatch, *given, "format=[coco,replicator]")
    assert json.loads((tmp_path / "run/metrics.json").read_text())["sequences"] == 2
    coco = json.loads((folder / "coco/annotations/instances_val.json").read_text())
    assert len(coco["images"]) == 18 and {a["category_id"] for a in coco["annotations"]} == {1, 2, 4}

    recording, back = f"recording={folder}/replicator/val/drone", tmp_path / "back"
    run_command(import_replicator, monkeypatch, recording, f"out={back}", "fps=30", run)
    before, after = read_capture(simulated / "set/val/drone"), read_capture(back)
    for index in range(3):
        np.testing.assert_array_equal(read_mask(after, index, 2), read_mask(before, index, 2))
    # A body of 1 m: the visible surface's mean lies within half of that of its origin.
    one, other = before.truth.objects[0].frames[2], after.truth.objects[0].frames[2]
    assert np.linalg.norm(np.subtract(one.position, other.position)) < 0.5


def test_a_pair_in_every_format(simulated, tmp_path, monkeypatch):
    folder, run = tmp_path / "out", f"hydra.run.dir={tmp_path}/run"
    formats = "format=[coco,yolo,mot,colmap,nerfstudio,replicator]"
    run_command(export_dataset, monkeypatch, f"dataset={simulated}/set/val/pair", f"out={folder}", formats, run)
    capture = read_capture(simulated / "set/val/pair")
    leaving = capture.truth.objects[1]
    gone = [not any(state.visible.values()) for state in leaving.frames]
    cut = sum(flag for state in leaving.frames for flag in state.truncated.values())
    assert gone[-1] and not gone[0] and cut > 0
    coco = json.loads((folder / "coco/annotations/instances_all.json").read_text())
    shown = [sum(state.visible.values()) for o in capture.truth.objects for state in o.frames]
    assert len(coco["annotations"]) == sum(shown)
    assert all({"visibility", "truncated", "amodal_bbox"} <= set(a) for a in coco["annotations"])
    assert sum(len(p.read_text().splitlines()) for p in (folder / "yolo/labels/all").iterdir()) == sum(shown)
    lines = [p.read_text().splitlines() for p in (folder / "mot/aerojax-all").glob("*/gt/gt.txt")]
    assert len(lines) == 3 and sum(map(len, lines)) == sum(shown)
    assert len(list((folder / "replicator/all/pair").glob("*/normals/normals_*.png"))) == 9

    recording, back = f"recording={folder}/replicator/all/pair", tmp_path / "back"
    run_command(import_replicator, monkeypatch, recording, f"out={back}", "fps=30", run)
    after = read_capture(back)
    assert [o.class_name for o in after.truth.objects] == ["bird", "helicopter"]
    for index in range(3):
        for frame in range(3):
            for read in (read_mask, read_depth):
                np.testing.assert_array_equal(read(after, index, frame), read(capture, index, frame))


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ("format=kitti", "unknown format 'kitti'"),
        ("images=move", "images"),
        ("dataset=/nowhere", "there is no /nowhere"),
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
