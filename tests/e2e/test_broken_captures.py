"""A broken capture ends the command line with code 2 and one clear message, and the folder stays as it was."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import jax
import pytest
from support.broken_captures import BROKEN, EXPECTED
from support.command_line import run_command

from aerojax.classify.base import untrained
from aerojax.classify.load import save_classifier
from aerojax.classify.mambasplat.config import MambaSplatConfig
from experiments import classify
from experiments._launch.command import REPOSITORY

AS_PROCESSES = ("no_capture_json", "pose_sheared", "rgb_cut")


@pytest.fixture(scope="module")
def weights(tmp_path_factory) -> Path:
    """A small untrained classifier: the capture is refused before it is asked."""
    path = tmp_path_factory.mktemp("weights") / "small.safetensors"
    config = MambaSplatConfig(d_model=16, depth=1, mamba_layers=1)
    save_classifier(path, untrained(config, tokens=16, frames=4, key=jax.random.key(0)))
    return path


def snapshot(folder: Path) -> dict[str, tuple[object, ...]]:
    """Names, kinds, times and bytes of everything in a folder; links are not followed."""

    def one(path: Path) -> tuple[object, ...]:
        if path.is_symlink():
            return ("link", str(path.readlink()))
        return ("file", path.stat().st_mtime_ns, path.read_bytes()) if path.is_file() else ("folder",)

    return {str(path.relative_to(folder)): one(path) for path in sorted(folder.rglob("*"))}


def arguments(folder: Path, weights: Path, run: Path) -> list[str]:
    return ["preset=smoke", f"capture={folder}", f"weights={weights}", f"hydra.run.dir={run}"]


def check_message(name: str, folder: Path, error: str) -> None:
    assert "Traceback" not in error
    assert error.startswith(f"error: capture {folder} has ")
    assert all(words in error for words in EXPECTED[name]), error
    # One line for the capture and one for each problem, nothing else.
    head, *problems = error.rstrip("\n").splitlines()
    assert len(problems) == int(head.split(" has ")[1].split()[0]) and all(p.startswith("  ") for p in problems)


@pytest.mark.parametrize("name", [n for n in BROKEN if n not in AS_PROCESSES])
def test_refused_by_the_command(name, weights, tmp_path, monkeypatch, capsys):
    folder = tmp_path / "capture"
    folder.mkdir()
    BROKEN[name](folder)
    before = snapshot(folder)
    with pytest.raises(SystemExit) as ended:
        run_command(classify, monkeypatch, *arguments(folder, weights, tmp_path / "run"))
    assert ended.value.code == 2
    output = capsys.readouterr()
    check_message(name, folder, output.err)
    assert output.out == ""
    assert snapshot(folder) == before
    assert not (tmp_path / "run/result.json").exists()


@pytest.mark.parametrize("name", AS_PROCESSES)
def test_refused_by_the_process(name, weights, tmp_path):
    folder = tmp_path / "capture"
    folder.mkdir()
    BROKEN[name](folder)
    before = snapshot(folder)
    command = [sys.executable, "-m", "experiments.classify", *arguments(folder, weights, tmp_path / "run")]
    done = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    check_message(name, folder, done.stderr)
    assert done.stdout == ""
    assert snapshot(folder) == before


def test_there_are_many_ways_to_break_a_capture():
    assert len(BROKEN) >= 25
