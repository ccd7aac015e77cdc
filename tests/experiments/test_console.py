"""The command `aerojax`: its list of acts, its mistakes, and that it starts what `python -m experiments` starts."""

from __future__ import annotations

import importlib
import subprocess
import sys

import pytest

from experiments._launch import console
from experiments._launch.command import REPOSITORY


def aerojax(*arguments):
    """Run `python -m aerojax` as a process."""
    command = [sys.executable, "-m", "aerojax", *arguments]
    return subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, check=False)


def test_acts_are_the_modules_that_have_a_command_line():
    known = console.acts()
    assert {"classify", "generate_dataset", "benchmark"} <= set(known) and not any(n.startswith("_") for n in known)
    for name, about in known.items():
        assert callable(importlib.import_module(f"experiments.{name}").main)
        assert 10 < len(about) <= 120 and about.endswith((".", "`.")), f"{name}: one sentence on one line"


def test_help_lists_acts():
    done = aerojax("--help")
    assert done.returncode == 0 and done.stderr == ""
    for name, about in console.acts().items():
        assert any(line.split(maxsplit=1) == [name, about] for line in done.stdout.splitlines())
    assert aerojax().stdout == aerojax("-h").stdout == done.stdout


def test_help_does_not_wait_for_jax():
    start = "import sys; from aerojax.__main__ import main; main(['--help'])"
    code = f"{start}; assert not {{'jax', 'hydra'}} & set(sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], cwd=REPOSITORY, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("name", "remedy"),
    [("clasify", "did you mean classify?"), ("train", "aerojax --help lists them"), ("_launch", "aerojax --help")],
)
def test_an_unknown_act_is_named(capsys, name, remedy):
    with pytest.raises(SystemExit) as ended:
        console.main([name])
    assert ended.value.code == 2
    error = capsys.readouterr().err
    assert error.startswith(f"error: there is no act {name!r}; ") and remedy in error


def test_an_act_gets_the_rest_of_the_command_line(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(sys, "argv", ["aerojax"])
    with pytest.raises(SystemExit) as ended:
        console.main(["classify", "sead=1", f"hydra.run.dir={tmp_path}"])
    assert ended.value.code == 2 and "sead" in capsys.readouterr().err
