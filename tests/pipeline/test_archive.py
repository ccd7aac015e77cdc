"""Archives: an answer a file, what is answered stays, errors are tried again, the order changes nothing."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from aerojax.pipeline import archive
from aerojax.pipeline.archive import AskedOfCapture, answers_in, classify_archive

FOLDERS = {name: Path("/archive") / name for name in ("b", "a/2", "a/1", "c")}


class Workers:
    """Answers jobs, those of the given names not at all; in reverse, as others may be faster."""

    def __init__(self, monkeypatch, **ends: dict | None) -> None:
        self.ends, self.asked = ends, []
        monkeypatch.setattr(archive, "run_surviving", self)

    def __call__(self, work, jobs, *, workers):
        for place, (_, folder) in reversed(list(enumerate(jobs))):
            name = str(folder.relative_to("/archive"))
            self.asked.append(name)
            if self.ends.get(name) == "killed":
                raise KeyboardInterrupt
            yield place, self.ends.get(name, {"status": "ok", "label": name})


def run(out):
    steps = []
    given = {"workers": 2, "cluster": "local", "progress": lambda *step: steps.append(step)}
    return classify_archive(FOLDERS, AskedOfCapture(), out, **given), steps


def test_answers_have_a_file_each_and_a_line_in_order(monkeypatch, tmp_path):
    Workers(monkeypatch)
    counts, steps = run(tmp_path)
    assert counts == {"ok": 4} and steps == [(n, 4, "captures") for n in range(5)]
    lines = [json.loads(line) for line in (tmp_path / "answers.jsonl").read_text().splitlines()]
    assert [one["capture"] for one in lines] == ["a/1", "a/2", "b", "c"]
    assert lines == list(answers_in(tmp_path, sorted(FOLDERS))) and lines[0]["label"] == "a/1"
    assert json.loads((tmp_path / "answers/a/1.json").read_text()) == lines[0]


def test_what_is_answered_is_not_asked_again(monkeypatch, tmp_path):
    killed = Workers(monkeypatch, **{"a/1": "killed"})
    with pytest.raises(KeyboardInterrupt):
        run(tmp_path)
    assert killed.asked == ["c", "b", "a/2", "a/1"] and not (tmp_path / "answers.jsonl").exists()
    broken = Workers(monkeypatch, **{"a/1": {"error": {"code": "missing", "text": "no"}}})
    counts, steps = run(tmp_path)
    assert counts == {"ok": 3, "error": 1} and broken.asked == ["a/1"] and steps[0] == (3, 4, "captures")
    dead = Workers(monkeypatch, **{"a/1": None})
    assert run(tmp_path)[0] == {"ok": 3, "error": 1} and dead.asked == ["a/1"]
    assert json.loads((tmp_path / "answers.jsonl").read_text().splitlines()[0])["error"]["code"] == "worker-died"
    mended = Workers(monkeypatch)
    assert run(tmp_path)[0] == {"ok": 4} and mended.asked == ["a/1"]
    whole = (tmp_path / "answers.jsonl").read_bytes()
    assert run(tmp_path)[0] == {"ok": 4} and mended.asked == ["a/1"]
    assert (tmp_path / "answers.jsonl").read_bytes() == whole
