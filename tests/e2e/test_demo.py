"""`make demo`: its commands are understood, and it runs the whole chain once."""

from __future__ import annotations

import json
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from support.act_configs import config_of, values_of
from support.pages import ROOT

from aerojax.core.config import to_dataclass
from aerojax.core.types import CLASSES

CHAIN = ["generate_dataset", "reconstruct_dataset", "train_classifier", "measure_accuracy", "classify"]
needs_make = pytest.mark.skipif(shutil.which("make") is None, reason="make is not installed")


def make_demo(folder: Path, *options: str) -> str:
    """What `make demo` prints, with the environment of these tests and another folder; nothing is installed."""
    environment = Path(sys.prefix)
    values = (f"DEMO={folder}", f"VENV={environment}", f"PY={sys.executable}")
    command = ["make", "--old-file", str(environment / ".installed"), *options, *values, "demo"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    return done.stdout


@needs_make
def test_commands_of_the_demo_are_understood(tmp_path):
    lines = make_demo(tmp_path / "demo", "--dry-run").splitlines()
    commands = [shlex.split(line.partition("/bin/aerojax ")[2]) for line in lines if "/bin/aerojax " in line]
    assert [act for act, *_ in commands] == CHAIN
    for act, *given in commands:
        to_dataclass(values_of(act, *given), config_of(act))


@needs_make
@pytest.mark.long
def test_the_demo_runs_the_chain_and_does_it_once(tmp_path):
    demo = tmp_path / "demo"
    assert str(demo / "classify/report.html") in make_demo(demo).splitlines()[-1]
    assert json.loads((demo / "train/metrics.json").read_text())["test"]["clips"] == 4
    figures = json.loads((demo / "evaluate/results.json").read_text())
    assert figures["all"]["clips"] == 4 and figures["weights"] == "train/weights.safetensors"
    result = json.loads((demo / "classify/result.json").read_text())
    assert set(result["probabilities"]) == set(CLASSES)
    kept = {path: path.stat().st_mtime_ns for path in demo.rglob("*") if path.is_file()}
    assert kept and len(make_demo(demo).splitlines()) == 1
    (demo / "classify/report.html").unlink()  # a step that was interrupted
    assert make_demo(demo).count("/bin/aerojax ") == 1
    others = {path for path in kept if "classify" not in path.parts}
    assert all(path.stat().st_mtime_ns == kept[path] for path in others)
