"""`train_classifier` as a process: killed at a random moment, and on two devices; the curve stays the same."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import jax
import numpy as np
import pytest
from support.clip_examples import random_clip

from aerojax.classify.load import load_classifier
from aerojax.core.types import CLASSES
from aerojax.data.clips import save_clip
from aerojax.training.checkpoint import latest_step

ROOT = Path(__file__).resolve().parents[2]
EPOCHS, STEPS = 6, 4
SIZES = (
    "preset=smoke",
    "tests=[]",
    "also_test=[]",
    "classify=mambasplat",
    "variation.tokens=16",
    f"training.epochs={EPOCHS}",
    "training.checkpoint_steps=3",
    "training.average=0.5",
    *(f"model.{name}" for name in ("token_features=8", "token_invariants=8", "channels=4", "heads=2", "head_dim=2")),
)


@pytest.fixture(scope="module")
def place(tmp_path_factory) -> Path:
    """A folder with clips of random Gaussians and a cache of compiled programs, which all processes share."""
    folder = tmp_path_factory.mktemp("training")
    for split, copies in (("train", STEPS), ("val", 1), ("test", 1)):
        for copy in range(copies):
            for index, label in enumerate(CLASSES):
                clip = np.array(random_clip(10 * copy + index, tokens=16))
                clip[..., 2] *= 1 + index  # something to learn
                save_clip(folder / "clips" / split / f"{label}_{copy}.npz", clip, label, f"{label}_{split}_{copy}")
    return folder


def begin(place: Path, name: str, *more: str, flags: str = "") -> subprocess.Popen:
    where = (f"clips=[{place}/clips]", f"hydra.run.dir={place}/{name}")
    cache = {"JAX_COMPILATION_CACHE_DIR": str(place / "cache"), "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0"}
    environment = {**os.environ, **cache, "JAX_PLATFORMS": "cpu", "XLA_FLAGS": flags}
    command = [sys.executable, "-m", "experiments.train_classifier", *SIZES, *where, *more]
    return subprocess.Popen(
        command, cwd=ROOT, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )


def end(process: subprocess.Popen) -> str:
    said, _ = process.communicate(timeout=400)
    assert process.returncode == 0, said[-3000:]
    return said


def history(place: Path, name: str) -> list[dict[str, float]]:
    return [json.loads(line) for line in (place / name / "history.jsonl").read_text().splitlines()]


def losses(place: Path, name: str) -> np.ndarray:
    return np.array([row["loss"] for row in history(place, name)])


@pytest.fixture(scope="module")
def whole(place) -> str:
    """What an uninterrupted run of one process on one device says on the screen."""
    return end(begin(place, "whole", "tensorboard=true"))


@pytest.mark.long
def test_a_run_tells_early_how_it_goes_and_leaves_its_origin(whole, place):
    assert f"step 1 of {EPOCHS * STEPS}: loss" in whole and "steps/s" in whole and "min left" in whole
    assert losses(place, "whole").shape == (EPOCHS,)
    card = load_classifier(place / "whole/weights.safetensors").card
    assert (card.tokens, card.frames, card.rotation) == (16, 4, "none")
    notes = json.loads(card.record)
    assert notes["trained"]["training"]["epochs"] == EPOCHS and notes["trained"]["variation"]["tokens"] == 16
    assert "never turned" in (place / "whole/weights.md").read_text()
    assert [path.name.startswith("events") for path in (place / "whole/curves").iterdir()] == [True]


@pytest.mark.long
def test_a_killed_process_ends_with_the_same_bits(whole, place):
    moment = random.Random()
    for _ in range(2):
        process, wanted = begin(place, "killed"), moment.randrange(1, EPOCHS * STEPS // 2)
        before = latest_step(place / "killed/checkpoints") or 0
        while process.poll() is None and (latest_step(place / "killed/checkpoints") or 0) < before + wanted:
            time.sleep(0.002)
        time.sleep(moment.uniform(0, 0.1))
        process.send_signal(signal.SIGKILL)
        said, _ = process.communicate()
        assert process.returncode == -signal.SIGKILL, said[-3000:]
        assert not (place / "killed/metrics.json").exists()
    end(begin(place, "killed"))
    assert (place / "killed/history.jsonl").read_bytes() == (place / "whole/history.jsonl").read_bytes()
    ours, theirs = (load_classifier(place / name / "weights.safetensors").network for name in ("killed", "whole"))
    assert all(np.array_equal(a, b) for a, b in zip(jax.tree.leaves(ours), jax.tree.leaves(theirs), strict=True))
    tests = [json.loads((place / name / "metrics.json").read_text())["tests"] for name in ("killed", "whole")]
    assert tests[0] == tests[1]


@pytest.mark.long
def test_two_devices_share_the_batch(whole, place):
    end(begin(place, "devices", flags="--xla_force_host_platform_device_count=2"))
    np.testing.assert_allclose(losses(place, "devices"), losses(place, "whole"), rtol=1e-3)
    assert not np.array_equal(losses(place, "devices"), losses(place, "whole"))  # sums in another order
