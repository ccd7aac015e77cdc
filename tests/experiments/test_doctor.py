"""What a machine can do is tried, and whatever goes wrong is a line of its own."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest
from support.command_line import run_command

from experiments import doctor
from experiments._doctor import checks
from experiments._launch.command import REPOSITORY


def test_here_everything_needed_works(monkeypatch, tmp_path, capsys):
    run_command(doctor, monkeypatch, f"hydra.run.dir={tmp_path}")
    shown = capsys.readouterr().out
    for words in ("aerojax", "jax ", "kernels", "compile and agree", "video mp4v", "images .png"):
        assert words in shown, words
    assert max(map(len, shown.splitlines()[:-1])) <= 80 and (tmp_path / "doctor.json").is_file()


def test_a_check_that_fails_ends_no_other(monkeypatch):
    def fails():
        raise RuntimeError("no such device\nmore")

    monkeypatch.setattr(checks, "CHECKS", {"kernels": fails, "machine": checks.CHECKS["machine"]})
    broken, fine = checks.findings()
    assert (broken.part, broken.state, broken.text) == ("kernels", "broken", "RuntimeError: no such device")
    assert fine.state == "ok" and "CPUs" in fine.text


def test_what_is_broken_ends_with_code_one(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(
        checks, "CHECKS", {"codecs": lambda: iter([checks.Finding("video", "[no] codec", "broken", "mend")])}
    )
    with pytest.raises(SystemExit) as ended:
        run_command(doctor, monkeypatch, f"hydra.run.dir={tmp_path}")
    assert ended.value.code == 1 and "[no] codec; mend" in capsys.readouterr().out


def test_a_kernel_that_differs_is_broken(monkeypatch):
    monkeypatch.setattr(checks, "kernel_difference", lambda: 0.5)
    (found,) = checks.CHECKS["kernels"]()
    assert found.state == "broken" and "0.5" in found.text


def test_a_codec_that_writes_rubbish_is_found(tmp_path):
    assert not checks._alike(np.zeros((2, 2, 3), np.uint8), np.full((2, 2, 3), 99, np.uint8))
    assert not checks._video_works(tmp_path / "a.mp4", "abcd", np.zeros((48, 64, 3), np.uint8))


def test_extras_are_those_of_the_project():
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["project"]
    assert set(checks.EXTRAS) <= set(project["optional-dependencies"])


def test_sizes_of_folders(tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "a/b").write_bytes(bytes(2**20))
    assert checks.megabytes(tmp_path) == 1.0 and checks.megabytes(tmp_path / "none") == 0.0
