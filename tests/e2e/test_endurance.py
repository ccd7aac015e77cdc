"""The acts that kill and soak at their smallest."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from support.command_line import run_command

from experiments import measure_soak

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.long
def test_killed_clips_go_on_to_the_same_bytes(tmp_path):
    command = [sys.executable, "-m", "experiments.measure_kills", "preset=smoke", f"hydra.run.dir={tmp_path}"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=900)
    found = json.loads((tmp_path / "results.json").read_text())
    assert found["failures"] == 0 and done.returncode == 0, found["acts"]
    assert found["kills"] == found["byte_equal"] == 2
    (act,) = found["acts"]
    assert act["act"] == "generate_clips" and len(act["moments"]) == 2 and act["seed"]


@pytest.mark.long
def test_a_stream_stays_as_it_is(monkeypatch, tmp_path):
    where = (f"sample.folder={tmp_path}/samples", f"assets={tmp_path}/assets", f"hydra.run.dir={tmp_path}/run")
    run_command(measure_soak, monkeypatch, "preset=smoke", *where)
    found = json.loads((tmp_path / "run/results.json").read_text())
    assert (found["frames"], found["updated"], found["compared"]) == (60, 60, 2)
    handles = [window["handles"] for window in found["windows"]]
    assert len(set(handles[1:])) == 1 and found["drift"] < 0.01
    assert found["windows"][-1]["resident_mb"] < found["windows"][1]["resident_mb"] + 5


@pytest.mark.long
def test_a_service_stays_as_it_is(monkeypatch, tmp_path):
    where = (f"sample.folder={tmp_path}/samples", f"assets={tmp_path}/assets", f"hydra.run.dir={tmp_path}/run")
    looks = ("service=true", "segment=voxel_vote", "track=several", "sample.sequence.frames=24")
    run_command(measure_soak, monkeypatch, "preset=smoke", *looks, *where)
    found = json.loads((tmp_path / "run/results.json").read_text())
    assert (found["frames"], found["dropped"], found["partial"], found["failed_sends"]) == (60, 0, 0, {})
    assert found["windows"][-1]["frames"] == 60 and sum(found["sightings"].values()) > 30
    told = [json.loads(line) for line in (tmp_path / "run/messages.jsonl").read_text().splitlines()]
    assert [told[0]["type"], told[-1]["type"]] == ["started", "stopped"]
    begun = sum(one["type"] == "appeared" for one in told)
    assert begun == found["windows"][-1]["begun"] > 0
