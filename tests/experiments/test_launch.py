"""The command line: what a run remembers, and how mistakes end."""

from __future__ import annotations

import errno
import json
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from support.command_line import run_command

from aerojax.core.errors import UserError
from aerojax.core.files import write_json
from experiments import classify
from experiments._launch.command import REPOSITORY, claim_folder, is_finished


def process(*arguments):
    command = [sys.executable, "-m", "experiments.classify", *arguments]
    return subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, check=False)


def test_json_appears_whole(tmp_path):
    path = tmp_path / "a.json"
    write_json(path, {"a": [1, 2]})
    assert json.loads(path.read_text()) == {"a": [1, 2]}
    with pytest.raises(TypeError):
        write_json(path, {"a": object()})
    assert json.loads(path.read_text()) == {"a": [1, 2]} and [p.name for p in tmp_path.iterdir()] == ["a.json"]


def test_a_run_remembers_how_it_was_started(monkeypatch, tmp_path, capsys):
    weights = tmp_path / "none.safetensors"
    with pytest.raises(SystemExit) as ended:
        run_command(
            classify, monkeypatch, "preset=smoke", "seed=4", f"weights={weights}", f"hydra.run.dir={tmp_path}/run"
        )
    assert ended.value.code == 2
    error = capsys.readouterr().err
    assert error == f"error: weights file {weights} does not exist; train a model or correct the path\n"
    remembered = json.loads((tmp_path / "run/run.json").read_text())
    assert remembered["experiment"] == "classify"
    assert remembered["overrides"] == ["preset=smoke", "seed=4", f"weights={weights}"]
    assert remembered["config"]["seed"] == 4 and remembered["config"]["sample"]["sequence"]["frames"] == 4
    assert remembered["versions"] and remembered["machine"]["cpus"]


@pytest.mark.parametrize(
    ("override", "named"),
    [
        ("sead=1", "sead"),
        ("pipeline.hull.grd=3", "grd"),
        ("preset=huge", "huge"),
        ("seed=one", "seed"),
        ("pipeline.hull.grid=2.5", "pipeline.hull.grid"),
        ("seed==", "seed"),
        ("sample.folder=???", "sample.folder"),
    ],
)
def test_a_wrong_override_is_one_message(monkeypatch, tmp_path, capsys, override, named):
    with pytest.raises(SystemExit) as ended:
        run_command(classify, monkeypatch, override, f"hydra.run.dir={tmp_path}/run")
    assert ended.value.code == 2
    output = capsys.readouterr()
    assert output.err.startswith("error: ") and named in output.err
    assert "Traceback" not in output.err and output.out == ""


def test_a_bug_keeps_its_traceback(monkeypatch, tmp_path):
    monkeypatch.setattr(classify, "load_classifier", lambda path: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        run_command(classify, monkeypatch, "preset=smoke", f"hydra.run.dir={tmp_path}/run")


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EROFS])
def test_a_full_or_read_only_disk_is_one_message(monkeypatch, tmp_path, capsys, code):
    def refuse(path):
        raise OSError(code, os.strerror(code), "weights")

    monkeypatch.setattr(classify, "load_classifier", refuse)
    with pytest.raises(SystemExit) as ended:
        run_command(classify, monkeypatch, "preset=smoke", f"hydra.run.dir={tmp_path}/run")
    assert ended.value.code == 2
    expected = f"error: weights: {os.strerror(code)}; free space there, or choose a place that takes files\n"
    assert capsys.readouterr().err == expected


def test_an_error_of_the_system_that_is_a_bug_keeps_its_traceback(monkeypatch, tmp_path):
    def refuse(path):
        raise BrokenPipeError(errno.EPIPE, "pipe")

    monkeypatch.setattr(classify, "load_classifier", refuse)
    with pytest.raises(BrokenPipeError):
        run_command(classify, monkeypatch, "preset=smoke", f"hydra.run.dir={tmp_path}/run")


def test_a_run_directory_below_a_file_is_one_message(monkeypatch, tmp_path, capsys):
    (tmp_path / "file").write_text("")
    with pytest.raises(SystemExit) as ended:
        run_command(classify, monkeypatch, "preset=smoke", f"hydra.run.dir={tmp_path}/file/run")
    assert ended.value.code == 2 and capsys.readouterr().err.startswith(f"error: {tmp_path}/file/run")


def test_unknown_override_as_a_process(tmp_path):
    done = process("sead=1", f"hydra.run.dir={tmp_path}")
    assert done.returncode == 2 and done.stdout == ""
    assert done.stderr.startswith("error: ") and "sead" in done.stderr and "Traceback" not in done.stderr


def test_help_names_presets_and_values():
    done = process("--help")
    assert done.returncode == 0 and done.stderr == ""
    assert done.stdout.startswith("python -m experiments.classify [CAPTURE] [key=value ...]")
    assert "preset=smoke|small|full" in done.stdout
    assert "pipeline.crop_size=INTEGER" in done.stdout and "capture=PATH" in done.stdout


def test_a_run_is_finished_by_its_last_file_and_its_configuration(tmp_path):
    config = {"seed": 0, "folders": ("a", "b"), "distribution": {"process": 0}}
    assert not is_finished(tmp_path / "absent", "metrics.json", config)
    write_json(tmp_path / "run.json", {"config": config})
    (tmp_path / "hydra").mkdir()
    assert not is_finished(tmp_path, "metrics.json", config)
    assert not is_finished(tmp_path, "metrics.json", config | {"seed": 1})  # that run left nothing behind
    write_json(tmp_path / "metrics.json", {})
    assert is_finished(tmp_path, "metrics.json", config)
    assert is_finished(tmp_path, "metrics.json", config | {"distribution": {"process": 1}}, ("distribution",))
    with pytest.raises(UserError, match=r"another configuration \(distribution, seed in run\.json\); delete it"):
        is_finished(tmp_path, "metrics.json", config | {"seed": 1, "distribution": {"process": 1}})


def test_runs_of_one_second_have_a_folder_each(tmp_path):
    wanted = str(tmp_path / "runs/classify/2026-01-01_12-00-00")
    with ThreadPoolExecutor(6) as pool:
        claimed = list(pool.map(claim_folder, [wanted] * 6))
    assert sorted(claimed) == [wanted, *(f"{wanted}-{number}" for number in range(2, 7))]
    assert all(Path(folder).is_dir() for folder in claimed)


def test_the_default_folder_of_a_run_is_claimed_once(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    for _ in range(2):
        with pytest.raises(SystemExit):
            run_command(classify, monkeypatch, "preset=smoke", "weights=none.safetensors")
    folders = sorted((tmp_path / "runs/classify").iterdir())
    assert len(folders) == 2
    assert all((folder / "run.json").is_file() and (folder / "hydra").is_dir() for folder in folders)


def test_small_programs_are_compiled_once_for_all_processes(tmp_path):
    script = "from experiments._launch.command import keep_compiled_code as keep; keep()\nimport jax; jax.jit(abs)(1.0)"
    own = {name: value for name, value in os.environ.items() if not name.startswith("JAX_")}
    own |= {"XDG_CACHE_HOME": str(tmp_path), "PYTHONPATH": str(REPOSITORY)}
    written = []
    for _ in range(2):
        subprocess.run([sys.executable, "-c", script], env=own, check=True)
        written.append({path: path.stat().st_mtime_ns for path in (tmp_path / "aerojax/xla").glob("*-cache")})
    assert any("jit_abs" in path.name for path in written[0]) and written[1] == written[0]
