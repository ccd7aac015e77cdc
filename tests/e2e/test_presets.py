"""Every preset of every act takes its steps: two of each loop, on little data of the size that its producers keep.

Overrides here cut how many there are (identities, clips, epochs, trials), never how large one of them is: what does not
fit together in a preset, such as clips with fewer tokens than training takes, ends here. `preset=smoke` is run whole by
the acts' own tests.
"""

from __future__ import annotations

import functools
import importlib
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.act_configs import NAMES, PRESETS, values_of
from support.clip_examples import random_clip
from support.command_line import run_command
from support.gltf_files import triangle

from aerojax.core.types import CLASSES
from aerojax.data.clips import VIEWS, save_clip
from aerojax.pipeline.config import PipelineConfig

WRITTEN = "metrics.json", "results.json", "result.json", "description.json", "bird.jpg"
"""What an act leaves in its run's directory."""
FEW_PIXELS = "images.samples=1", "images.normals=false", "images.flow=false", "images.depth=false"
RIGS = {
    "sim1": ("radii=[100]",),
    "sim2": ("rig.sites=1",),
    "sim3": ("rig.sites=1",),
    "random": ("crowd.per_family=1", "sequences={train: 1, val: 0, test: 0}"),
}
ONE_CLIP = "factory.individuals=1", "factory.clips=1", "factory.least_frames=1"
CURVES = "calibration_deg", "clock_ms", "mask_growth", "cameras", "width_px", "distance_m"
ON_CLIPS = {
    "train_classifier": (
        ("training.epochs=1", "training.batch=2", "training.micro_batches=1"),
        {"small": ("networks=2",), "published": ("classify=mambasplat",)},
    ),
    "eval_rotation": (("trials=1", "draws=10", "model=mambasplat"), {}),
    "measure_accuracy": (("draws=10",), {}),
    "measure_drift": (("count=2", "rotations=1", "double=1"), {}),
    "describe_clips": (("split=test", "workers=1"), {}),
    "measure_frames": (("models=[mambasplat]", "trials.orders=1", "trials.draws=10", "trials.token_ensembles=1"), {}),
}
"""Acts on clips: what makes each short, and more of that by preset."""
FEW_CONDITIONS = tuple(
    f"conditions.{name}"
    for name in ("identities=1", "contexts=[]", "masks=[]", "swept=1", "distances=[]", "recorded=1", "rigs=[]")
)
ALONE = {
    "count_networks": ((), {}),
    "classify": (("sample.sequence.frames=2",), {}),
    "doctor": ((), {}),
    "draw_contact_sheets": (("splits=[val]", "labels=[bird]"), {}),
    "eval_reconstructor": (("entrants=[constant]", "pictures=1", "repeats=1", *FEW_CONDITIONS), {}),
    "fit_gaussians": (("fit.steps=2", "fit.report_every=1"), {}),
    "fuzz": (("seconds=1", "only=[obj]", "workers=1"), {}),
    "generate_clips": (("individuals=1", "clips=1", "least_frames=1", "workers=1"), {}),
    "generate_shapes": (("per_class={train: 1, val: 1, test: 1}", "tokens=32", "versions=1"), {}),
    "generate_views": (("objects=2", "poses=1", "attempts=4", "workers=1"), {}),
    "measure_colour_leak": (("per_class=1", "views=1", "permutations=2"), {}),
    "measure_cost": (("variant=[exact]", "mode=[X]", "untrained=[]", "repeats=2"), {}),
    "measure_robustness": (
        (*ONE_CLIP, "workers=1", "draws=10", f"curves={{{', '.join(f'{name}: []' for name in CURVES)}}}"),
        {},
    ),
    "reproduce": ((), {}),
    "measure_tracking": (("only=[tracks]", "scenes=1", "flown.frames=60"), {}),
    "measure_soak": (("frames=12", "windows=2", "settled=0", "sample.sequence.frames=4"), {}),
}
"""Acts that need no data."""
SMALL_LGM = (
    *("reconstruct=lgm", "model.size=16", "model.down=[16,16]", "model.up=[16]"),
    *("model.attends_down=[false,true]", "model.attends_up=[false]"),
)
ONLY_COUNTS = {"measure_kills": ("kills=2", "only=[]")}
"""Acts whose presets say how often and nothing else: what makes them one."""
ON_DATASETS = ("describe_dataset", "reconstruct_dataset")
SWEEPS = ("compare_classifiers",)
pytestmark = pytest.mark.long


def size_of(preset: str) -> tuple[int, int]:
    """Tokens and frames of the clips that are made for a preset; `published` has its own line in its file."""
    made = values_of("reconstruct_dataset", f"preset={'full' if preset == 'published' else preset}")
    frames = values_of("train_classifier", f"preset={preset}")["frames"]
    return made["tokens"], min(frames, values_of("generate_clips", "preset=full")["frames"])


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("presets")


@pytest.fixture(scope="module")
def clips_of(folder):
    """By preset: one rig's clips of every split, one a class, with crops."""

    def make(preset: str) -> Path:
        place = folder / f"clips_{preset}"
        tokens, frames = size_of(preset)
        size = PipelineConfig().view_size
        for number, split in enumerate(("train", "val", "test")):
            for label, name in enumerate(CLASSES):
                rng = np.random.default_rng([number, label])
                crops = rng.integers(0, 255, (frames, VIEWS, size, size, 4), dtype=np.uint8)
                columns = np.asarray(random_clip(10 * number + label, time=frames, tokens=tokens))
                valid = np.ones((frames, VIEWS), bool)
                save_clip(
                    place / split / f"{name}.npz", columns, name, f"{name}_{split}", crops=crops, crop_valid=valid
                )
        return place

    return functools.cache(make)


@pytest.fixture(scope="module")
def dataset(folder) -> Path:
    """One bird's flight, in as few pixels as may be."""
    with pytest.MonkeyPatch.context() as patch:
        few = ("preset=smoke", "rig=random", "classes=[bird]", "frames=2", "sequences={train: 1, val: 1, test: 1}")
        where = (f"folder={folder}/data", f"hydra.run.dir={folder}/generate", "workers=1", "images.samples=1")
        run_command(importlib.import_module("experiments.generate_dataset"), patch, *few, *where)
    return folder / "data"


def done_already(act: str, preset: str, *overrides: str) -> bool:
    """Whether `preset=small` becomes the same run by these overrides, so that it need not be done again."""
    if preset == "small":
        return False
    found = [values_of(act, f"preset={one}", *overrides) for one in ("small", preset)]
    texts = [json.dumps(values, default=str, sort_keys=True) for values in found]
    return texts[0].replace("small", "…") == texts[1].replace(preset, "…")


def run(patch: pytest.MonkeyPatch, act: str, preset: str, out: Path, *more: str) -> dict[str, Any]:
    """Run an act and return what it wrote in its run's directory."""
    run_command(importlib.import_module(f"experiments.{act}"), patch, f"preset={preset}", f"hydra.run.dir={out}", *more)
    left = [out / name for name in WRITTEN if (out / name).is_file()]
    assert left, f"{act} left nothing in {sorted(path.name for path in out.iterdir())}"
    return json.loads(left[0].read_text()) if left[0].suffix == ".json" else {}


@pytest.mark.parametrize("preset", ["small", "full", "published"])
@pytest.mark.parametrize("act", ON_CLIPS)
def test_acts_on_clips(act, preset, clips_of, monkeypatch, tmp_path):
    if preset not in PRESETS[act]:
        return
    clips, (short, by_preset) = clips_of(preset), ON_CLIPS[act]
    places = {"measure_accuracy": ("tests", "also"), "measure_frames": ("tests",)}
    places |= {"train_classifier": ("clips", "tests", "also_test")}
    keys = places.get(act, ("clips",))
    where = [f"{keys[0]}=[{clips}]", *(f"{key}=[]" for key in keys[1:])]
    if act == "eval_rotation":
        where.append(f"rotations={tmp_path}/rotations")
    overrides = (*short, *by_preset.get(preset, ()), *where)
    found = run(monkeypatch, act, preset, tmp_path / "run", *overrides)
    if act == "train_classifier":
        rows = (tmp_path / "run/history.jsonl").read_text().splitlines()
        assert len(rows) == 1 and np.isfinite(json.loads(rows[0])["loss"]) and found["test"]["clips"] == 4


@pytest.mark.parametrize("preset", ["small", "full"])
@pytest.mark.parametrize("act", ALONE)
def test_acts_that_need_no_data(act, preset, folder, monkeypatch, tmp_path):
    short, by_preset = ALONE[act]
    keys = values_of(act)
    where = [f"assets={folder}/assets"] if "assets" in keys else []
    where += [f"folder={tmp_path}/made"] if "folder" in keys else []
    where += [f"sample.folder={tmp_path}/samples"] if "sample" in keys else []
    where += [f"page={tmp_path}/page.md"] if "page" in keys else []
    overrides = (*short, *by_preset.get(preset, ()), *where)
    if not done_already(act, preset, *overrides):
        run(monkeypatch, act, preset, tmp_path / "run", *overrides)


@pytest.mark.parametrize("preset", ["small", "full"])
@pytest.mark.parametrize("rig", RIGS)
def test_data_sets(rig, preset, monkeypatch, tmp_path):
    few = ("identities_per_class=1", "classes=[bird]", "frames=2", "workers=1", *FEW_PIXELS)
    sequences = () if rig == "random" else ("sequences={train: 0, val: 0, test: 1}",)
    where = (f"rig={rig}", f"folder={tmp_path}/data")
    found = run(monkeypatch, "generate_dataset", preset, tmp_path / "run", *where, *few, *sequences, *RIGS[rig])
    assert found["complete"] and found["images_written"] > 0


@pytest.mark.parametrize("preset", ["small", "full"])
@pytest.mark.parametrize("act", ON_DATASETS)
def test_acts_on_data_sets(act, preset, dataset, monkeypatch, tmp_path):
    where = {
        "describe_dataset": (f"dataset={dataset}", "depth=false"),
        "reconstruct_dataset": (f"datasets=[{dataset}]", f"folder={tmp_path}/clips"),
    }
    if not done_already(act, preset, *where[act]):
        assert run(monkeypatch, act, preset, tmp_path / "run", *where[act], "workers=1")


@pytest.mark.parametrize("preset", ["small", "full"])
def test_sweeps(preset, clips_of, monkeypatch, tmp_path):
    (act,) = SWEEPS
    data = (f"clips=[{clips_of(preset)}]", "tests=[]", "also_test=[]", f"test.rotations={tmp_path}/rotations")
    few = (
        "classifier=E_C",
        "seed=0",
        "networks=1",
        "training.epochs=1",
        "training.batch=2",
        "training.micro_batches=1",
    )
    where = (f"hydra.sweep.dir={tmp_path}/sweep", "test.trials=1", "test.draws=10")
    module = importlib.import_module(f"experiments.{act}")
    run_command(module, monkeypatch, "-m", f"preset={preset}", *data, *few, *where)
    assert json.loads((tmp_path / "sweep/table.json").read_text())["runs"] == 1


@pytest.mark.parametrize("preset", ["small", "full"])
def test_imported_models(preset, monkeypatch, tmp_path):
    triangle().write(tmp_path / "a.glb")
    models = tmp_path / "models.yaml"
    models.write_text("models:\n  - {name: kite, file: a.glb, class: bird, forward: +Z, up: +Y}\n")
    where = (f"models={models}", f"out={tmp_path}/out", f"assets={tmp_path}/assets")
    assert "kite" in run(monkeypatch, "import_models", preset, tmp_path / "run", *where)


@pytest.mark.parametrize("preset", ["small", "full"])
def test_a_reconstructor(preset, monkeypatch, tmp_path):
    few = ("objects=2", "poses=1", "attempts=4", "workers=1", f"folder={tmp_path}/views")
    for split in ("train", "val"):
        run(monkeypatch, "generate_views", preset, tmp_path / split, f"split={split}", *few)
    short = (*SMALL_LGM, "training.epochs=1", "training.batch=1", "val_scenes=1")
    found = run(monkeypatch, "train_reconstructor", preset, tmp_path / "run", f"views=[{tmp_path}/views]", *short)
    assert found["scenes"]["train"] == 2


@pytest.mark.parametrize("preset", ["small", "full"])
def test_a_detector(preset, dataset, monkeypatch, tmp_path):
    short = ("per_rig=1", "training.epochs=1", "training.batch=1", "learn.frames=1", "learn.cameras=1", "draws=10")
    found = run(monkeypatch, "train_detector", preset, tmp_path / "run", f"dataset={dataset}", *short)
    assert found["test"]["clips"] == 1 and found["images"]["count"] > 2


def test_no_preset_is_left_out():
    """Acts that are not run here have one configuration whatever the preset, but for names of folders."""
    run_here = {*ON_CLIPS, *ALONE, *ON_DATASETS, *SWEEPS, "generate_dataset", "import_models", "train_reconstructor"}
    run_here |= {"train_detector"}
    for act in set(NAMES) - run_here:
        configs = [
            json.dumps(values_of(act, f"preset={preset}", *ONLY_COUNTS.get(act, ())), default=str, sort_keys=True)
            for preset in PRESETS[act]
        ]
        configs = [text.replace(preset, "…") for text, preset in zip(configs, PRESETS[act], strict=True)]
        assert len(set(configs)) == 1, f"{act} differs by preset; run it here"
