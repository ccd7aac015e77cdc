"""Acts over many captures: names of their own, and a defective capture has its line while the others finish."""

from __future__ import annotations

import json
from pathlib import Path

import jax
import pytest
from support.command_line import run_command

from aerojax.classify.base import untrained
from aerojax.classify.load import save_classifier
from aerojax.classify.mambasplat.config import MambaSplatConfig
from aerojax.core.errors import UserError
from experiments import classify_archive, classify_folder, fit_gaussians
from experiments._launch.batches import exit_code, find_captures, result_folders


def test_captures_of_one_name_are_told_apart(tmp_path):
    for place in ("site1/flight01", "site2/flight01", "alone"):
        (tmp_path / place).mkdir(parents=True)
        (tmp_path / place / "capture.json").touch()
    assert list(find_captures(tmp_path)) == ["alone", "site1/flight01", "site2/flight01"]
    with pytest.raises(UserError, match=r"captures=.*none holds no folder with a capture\.json"):
        find_captures(tmp_path / "none")


def test_links_to_folders_are_not_followed(tmp_path):
    (tmp_path / "outside").mkdir()
    (tmp_path / "outside/capture.json").touch()
    (tmp_path / "inside/a").mkdir(parents=True)
    (tmp_path / "inside/a/capture.json").touch()
    (tmp_path / "inside/b").symlink_to(tmp_path / "outside")
    (tmp_path / "inside/a/c").symlink_to(tmp_path / "inside")
    assert list(find_captures(tmp_path / "inside")) == ["a"]


def test_results_of_captures_of_one_name_have_a_folder_each():
    captures = [Path(p) for p in ("/s1/f", "/s2/f", "/s3/f-2", "/s4/f", "/s5/g")]
    names = result_folders(captures)
    assert names == ["f", "f-2", "f-2-2", "f-3", "g"] and len(set(names)) == 5


def test_the_code_tells_how_many_failed():
    assert [exit_code(0, 3), exit_code(1, 2), exit_code(3, 0)] == [0, 1, 2]


@pytest.fixture(scope="module")
def weights(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("weights") / "small.safetensors"
    config = MambaSplatConfig(d_model=16, depth=1, mamba_layers=1)
    save_classifier(path, untrained(config, tokens=16, frames=4, key=jax.random.key(0)))
    return path


def run(act, monkeypatch, *arguments: str) -> int:
    try:
        run_command(act, monkeypatch, "preset=smoke", *arguments)
    except SystemExit as ended:
        return int(ended.code or 0)
    return 0


def test_a_defective_capture_does_not_end_the_others(shared, weights, tmp_path, monkeypatch, capsys):
    """One of three shows nothing: the others have their answers, its line says why, the code is 1."""
    folder = shared / "bugs/captures/folder_with_one_empty"
    if not folder.is_dir():
        pytest.skip(f"{folder} is absent")
    arguments = (f"weights={weights}", f"hydra.run.dir={tmp_path}/run")
    assert run(classify_folder, monkeypatch, f"captures={folder}", *arguments) == 1
    rows = {row["capture"]: row for row in json.loads((tmp_path / "run/metrics.json").read_text())["captures"]}
    bad = [name for name, row in rows.items() if "error" in row]
    assert set(rows) == {"a", "b", "c"} and len(bad) == 1
    assert all(abs(sum(row["probabilities"].values()) - 1) < 1e-5 for row in rows.values() if "error" not in row)
    output = capsys.readouterr()
    assert f"{bad[0]}: not classified: " in output.out and "1 of 3 captures were not classified" in output.err
    assert "every mask of the capture is empty" in rows[bad[0]]["error"]["text"]


def test_two_captures_of_one_name_have_their_own_rows(shared, weights, tmp_path, monkeypatch):
    folder = shared / "bugs/captures/samename"
    if not folder.is_dir():
        pytest.skip(f"{folder} is absent")
    arguments = (f"weights={weights}", f"hydra.run.dir={tmp_path}/run")
    assert run(classify_folder, monkeypatch, f"captures={folder}", *arguments) == 0
    rows = json.loads((tmp_path / "run/metrics.json").read_text())["captures"]
    assert [row["capture"] for row in rows] == ["site1/flight01", "site2/flight01"]


def test_archives_of_one_name_are_refused(tmp_path):
    for place in ("s1/f/a", "s2/f/b", "s2/g/b"):
        (tmp_path / place).mkdir(parents=True)
        (tmp_path / place / "capture.json").touch()
    both = classify_archive.named((tmp_path / "s1/f", tmp_path / "s2/g"))
    assert both == {"f/a": tmp_path / "s1/f/a", "g/b": tmp_path / "s2/g/b"}
    assert list(classify_archive.named((tmp_path / "s1/f/a",))) == ["a"]
    assert list(classify_archive.named((tmp_path / "s2",))) == ["f/b", "g/b"]
    (tmp_path / "s2/f/a").mkdir()
    (tmp_path / "s2/f/a/capture.json").touch()
    with pytest.raises(UserError, match="are both f/a"):
        classify_archive.named((tmp_path / "s1/f", tmp_path / "s2/f"))


@pytest.mark.long
@pytest.mark.parametrize("cluster", ["local", "ray"])
def test_archives_have_the_same_answers_whoever_classifies(cluster, shared, weights, tmp_path, monkeypatch, capsys):
    """One of three captures shows nothing; one worker here, two there, and a run that goes on."""
    folder = shared / "bugs/captures/folder_with_one_empty"
    if not folder.is_dir():
        pytest.skip(f"{folder} is absent")
    if cluster == "ray":
        pytest.importorskip("ray", reason="Ray is not installed; it comes with the extra `cluster`")
        monkeypatch.setenv("RAY_AUTH_MODE", "disabled")
        monkeypatch.setenv("PYTHONPATH", str(Path(__file__).resolve().parents[2]))
    said, given = [], (f"captures=[{folder}]", f"weights={weights}")
    for place, workers, where in (("one", 1, "local"), ("two", 2, cluster)):
        run_directory = f"hydra.run.dir={tmp_path}/{place}"
        assert run(classify_archive, monkeypatch, *given, run_directory, f"workers={workers}", f"cluster={where}") == 1
        said.append((tmp_path / place / "answers.jsonl").read_bytes())
    assert said[0] == said[1] and said[0].count(b"\n") == 3
    rows = [json.loads(line) for line in said[0].splitlines()]
    assert [row["capture"] for row in rows] == ["a", "b", "c"] and sum("error" in row for row in rows) == 1
    answered = next(row["capture"] for row in rows if "error" not in row)
    before = (tmp_path / f"two/answers/{answered}.json").stat().st_mtime_ns
    (tmp_path / "two/metrics.json").unlink()
    assert run(classify_archive, monkeypatch, *given, f"hydra.run.dir={tmp_path}/two", "workers=1") == 1
    assert (tmp_path / f"two/answers/{answered}.json").stat().st_mtime_ns == before
    assert (tmp_path / "two/answers.jsonl").read_bytes() == said[0]
    assert json.loads((tmp_path / "two/metrics.json").read_text())["statuses"]["error"] == 1
    assert "1 of 3 captures were not classified" in capsys.readouterr().err


def test_nothing_but_defective_captures(tmp_path, weights, monkeypatch, capsys):
    for name in ("a", "b [red]"):
        (tmp_path / "captures" / name).mkdir(parents=True)
        (tmp_path / "captures" / name / "capture.json").write_text("{")
    arguments = (f"captures={tmp_path}/captures", f"weights={weights}", f"hydra.run.dir={tmp_path}/run")
    assert run(classify_folder, monkeypatch, *arguments) == 2
    output = capsys.readouterr()
    assert "2 of 2 captures were not classified" in output.err and "b [red]: not classified" in output.out
    assert len(json.loads((tmp_path / "run/metrics.json").read_text())["captures"]) == 2


def test_a_fit_that_fails_does_not_end_the_others(tmp_path, monkeypatch, capsys):
    for name in ("s1/f", "s2/f"):
        (tmp_path / name).mkdir(parents=True)
        (tmp_path / name / "capture.json").write_text("{")
    where = f"captures=[{tmp_path}/s1/f,{tmp_path}/s2/f]"
    assert run(fit_gaussians, monkeypatch, where, f"hydra.run.dir={tmp_path}/run") == 2
    record = json.loads((tmp_path / "run/summary.json").read_text())
    assert record["fits"] == [] and [row["capture"] for row in record["failed"]] == [
        f"{tmp_path}/s{i}/f" for i in (1, 2)
    ]
    assert "2 of 2 captures were not fitted" in capsys.readouterr().err
