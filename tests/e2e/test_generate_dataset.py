"""The data set as users make it: same bytes whatever the workers and kills, a manifest that loads, truth that fits."""

from __future__ import annotations

import hashlib
import importlib.util
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from pxr import Usd
from support.command_line import run_command

from aerojax.capture.format import read_capture
from aerojax.capture.frames import read_coverage, read_depth, read_flow, read_mask, read_normal
from aerojax.capture.validate.examination import problems
from aerojax.geometry.boxes import box_iou
from aerojax.geometry.cameras import project_points
from experiments import generate_dataset

ROOT = Path(__file__).resolve().parents[2]
SMALL = ("rig=sim1", "preset=smoke", "classes=[bird,drone]", "sequences.train=0", "frames=2", "images.samples=2")
SIZE = ("rig.fixed.width=640", "rig.fixed.height=360", "rig.fixed.focal_px=1400.0")
SEQUENCES = 4  # two identities, two elevations
pytestmark = pytest.mark.slow


def command(dataset: Path, *overrides: str) -> list[str]:
    run = f"hydra.run.dir={dataset.with_name(dataset.name + '_run')}"
    return [sys.executable, "-m", "experiments.generate_dataset", *SMALL, *SIZE, f"folder={dataset}", run, *overrides]


def generate(dataset: Path, *overrides: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command(dataset, *overrides), cwd=ROOT, capture_output=True, text=True, timeout=500)


def tree(folder: Path) -> dict[str, str]:
    files = (path for path in folder.rglob("*") if path.is_file())
    return {str(p.relative_to(folder)): hashlib.blake2b(p.read_bytes()).hexdigest() for p in sorted(files)}


@pytest.fixture(scope="module")
def dataset(tmp_path_factory) -> Path:
    """Made by one process."""
    folder = tmp_path_factory.mktemp("dataset") / "one"
    dry = generate(folder, "dry_run=true", "workers=1")
    assert dry.returncode == 0, dry.stderr
    assert not folder.exists()
    done = generate(folder, "workers=1")
    assert done.returncode == 0, done.stderr
    assert f"{SEQUENCES} sequences made, 32 images" in done.stdout and "complete" in done.stdout
    listed = sorted(line.removeprefix("todo ") for line in dry.stdout.splitlines() if line.startswith("todo "))
    assert listed == sorted(s["folder"] for s in manifest_of(folder)["sequences"])
    assert f"2 identities, {SEQUENCES} sequences, {2 * SEQUENCES} frames, {8 * SEQUENCES} images" in dry.stdout
    return folder


def beside(dataset: Path, name: str, *, assets: bool) -> Path:
    """A folder for the same data set: with the notes on the generator, whose commit may change meanwhile."""
    other = dataset.with_name(name)
    shutil.copytree(dataset / "rigs", other / "rigs")
    if assets:
        shutil.copytree(dataset / "assets", other / "assets")
    return other


def manifest_of(folder: Path) -> dict:
    return json.loads((folder / "dataset.json").read_text())


def test_two_workers_make_the_same_bytes(dataset):
    other = beside(dataset, "two", assets=False)
    done = generate(other, "workers=2")
    assert done.returncode == 0, done.stderr
    assert tree(other) == tree(dataset)


@pytest.mark.long
def test_a_killed_run_goes_on_where_it_stopped(dataset):
    other = beside(dataset, "killed", assets=True)
    process = subprocess.Popen(
        command(other, "workers=2"), cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    end = time.monotonic() + 300
    while not list(other.glob("*/*/sequence.json")) and process.poll() is None and time.monotonic() < end:
        time.sleep(0.02)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    time.sleep(1.0)  # workers notice within milliseconds that their parent is gone
    finished = [path.parent for path in other.glob("*/*/sequence.json") if not path.parent.name.endswith(".partial")]
    assert len(finished) < SEQUENCES and not (other / "dataset.json").exists()
    before = {path: path.stat().st_mtime_ns for folder in finished for path in folder.rglob("*.png")}
    done = generate(other, "workers=1")
    assert done.returncode == 0, done.stderr
    assert f"{SEQUENCES - len(finished)} sequences made" in done.stdout
    assert tree(other) == tree(dataset)
    assert all(path.stat().st_mtime_ns == moment for path, moment in before.items())


@pytest.mark.long
def test_shards_make_the_same_data_set_between_them(dataset):
    other = beside(dataset, "shards", assets=True)
    first = generate(other, "shards=2", "shard=0", "workers=1")
    assert first.returncode == 0 and "other shards are still missing" in first.stdout, first.stderr
    assert not (other / "dataset.json").exists()
    second = generate(other, "shards=2", "shard=1", "workers=1")
    assert second.returncode == 0 and "complete" in second.stdout, second.stderr
    assert tree(other) == tree(dataset)


def test_every_sequence_is_a_capture_in_order(dataset):
    manifest = manifest_of(dataset)
    assert [(i["class"], i["split"]) for i in manifest["identities"]] == [("bird", "test"), ("drone", "test")]
    for entry in manifest["sequences"]:
        folder = dataset / entry["folder"]
        assert problems(folder) == []
        capture = read_capture(folder)
        assert (capture.frames, len(capture.cameras)) == (entry["frames"], entry["cameras"]) == (2, 4)
        (flown,) = capture.truth.objects
        assert (flown.class_name, flown.identity) == (entry["class"], entry["identity"])
        assert entry["distance_m"] == pytest.approx(32.0, abs=1e-3) and entry["frames_below_min_cameras"] == []
        stage = Usd.Stage.Open(str(folder / "scene.usda"))
        assert stage.GetPrimAtPath("/World/Object").GetAllChildren()
    assert not list(dataset.rglob("*.partial"))


def test_truth_fits_the_images(dataset):
    overlaps, offsets = [], []
    for entry in manifest_of(dataset)["sequences"]:
        capture = read_capture(dataset / entry["folder"])
        for state in capture.truth.objects[0].frames:
            for index, camera in enumerate(capture.cameras):
                name = camera.name
                mask, coverage = read_mask(capture, index, state.frame), read_coverage(capture, index, state.frame)
                rows, columns = np.nonzero(mask == 1)
                box = (columns.min(), rows.min(), columns.max() + 1, rows.max() + 1)
                assert state.bbox[name] == tuple(float(v) for v in box) and state.visible[name]
                assert state.visibility[name] == pytest.approx(1.0, abs=1e-6) and not state.truncated[name]
                overlaps.append(box_iou(state.bbox[name], state.projected_box[name]))
                centre = project_points(np.array([state.surface_centroid[name]]), camera)[0]
                y, x = np.nonzero(coverage)
                weight = coverage[y, x]
                offsets.append(
                    np.hypot(*(centre - [weight @ (x + 0.5) / weight.sum(), weight @ (y + 0.5) / weight.sum()]))
                )
                depth, normal = read_depth(capture, index, state.frame), read_normal(capture, index, state.frame)
                assert (depth[mask == 1] > 30).all()
                # A rod may pass through a pixel's centre and between its samples.
                assert (depth[coverage == 0] > 0).sum() <= 0.05 * (mask == 1).sum()
                assert (np.linalg.norm(normal[mask == 1], axis=1) > 0.99).mean() > 0.9
                assert read_flow(capture, index, state.frame).shape == (360, 640, 2)
            assert state.joints
    assert np.median(overlaps) > 0.85 and min(overlaps) > 0.6  # a metre spans 44 pixels
    assert max(offsets) < 0.25


def test_card_licence_and_metadata(dataset):
    card = (dataset / "README.md").read_text()
    assert card.startswith("---\nlicense: cc-by-4.0\n") and "| sim1 | test | 1 | 1 | 0 | 0 | 4 | 8 |" in card
    assert "CC BY 4.0" in (dataset / "LICENSE").read_text()
    metadata = json.loads((dataset / "croissant.json").read_text())
    needed = {"@context", "@type", "name", "description", "conformsTo", "license", "distribution", "recordSet"}
    assert needed <= set(metadata) and metadata["conformsTo"].endswith("croissant/1.1")
    (listing,) = metadata["distribution"]
    assert listing["sha256"] == hashlib.sha256((dataset / "dataset.json").read_bytes()).hexdigest()
    assert {f["name"] for f in metadata["recordSet"][0]["field"]} <= set(manifest_of(dataset)["sequences"][0])
    everything = "".join((dataset / n).read_text() for n in ("dataset.json", "README.md", "croissant.json"))
    assert str(dataset.parent) not in everything and str(ROOT) not in everything


def test_croissant_loads_in_its_own_library(dataset):
    if importlib.util.find_spec("mlcroissant") is None:
        pytest.skip("mlcroissant is not installed; pip install mlcroissant to run this test")
    import mlcroissant  # pyrefly: ignore

    records = list(mlcroissant.Dataset(jsonld=str(dataset / "croissant.json")).records("sequences"))
    assert len(records) == SEQUENCES and {r["sequences/class"] for r in records} == {b"bird", b"drone"}


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        (("shard=2", "shards=2"), "shard=2 of shards=2 does not exist; use 0 to 1"),
        (("seed=1",), "holds what was made with another seed; choose another folder"),
        (("radii=[3]",), "radii is [3.0]; choose among"),
        (("models=nowhere.yaml",), "nowhere.yaml"),
    ],
)
def test_mistakes_are_told_in_one_line(dataset, overrides, words, monkeypatch, capsys):
    before = tree(dataset)
    with pytest.raises(SystemExit) as ended:
        run_command(generate_dataset, monkeypatch, *command(dataset, *overrides)[3:])
    told = capsys.readouterr().err
    assert ended.value.code == 2 and words in told and "Traceback" not in told
    assert tree(dataset) == before
