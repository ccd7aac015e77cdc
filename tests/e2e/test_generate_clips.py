"""The act: clips of every class in a folder that loads, figures of the run, a second split beside the first."""

from __future__ import annotations

import json

import pytest
from support.command_line import run_command

from aerojax.core.types import CLASSES
from aerojax.data.clips import clip_files, load_clip
from experiments import generate_clips


@pytest.mark.slow
def test_clips_are_made_and_another_split_joins_them(tmp_path, monkeypatch):
    folder, small = tmp_path / "clips", ("preset=smoke", "workers=1", "rigs.cameras=[3,4]", "rigs.width_px=[20,40]")
    for split in ("train", "test"):
        where = (f"folder={folder}", f"split={split}", f"hydra.run.dir={tmp_path}/{split}")
        run_command(generate_clips, monkeypatch, *small, "faults.clock_ms=[33,33]", *where)
        metrics = json.loads((tmp_path / split / "metrics.json").read_text())
        assert metrics["new"] == 4 and metrics["unusable"] == [] and sum(metrics["clips"].values()) == 4
        assert {name.rpartition("/")[2] for name in metrics["clips"]} == {split}
        clips = [load_clip(path) for place in metrics["clips"] for path in clip_files(folder / place)]
        assert sorted(clip.label for clip in clips) == sorted(CLASSES)
        assert {clip.facts["clock_ms"] for clip in clips} == {33.0}
        assert {clip.columns.shape[1:] for clip in clips} == {(512, 14)}


def test_another_configuration_is_refused(tmp_path, monkeypatch, capsys):
    (tmp_path / "manifest.json").write_text("{}")
    with pytest.raises(SystemExit) as stopped:
        run_command(generate_clips, monkeypatch, "preset=smoke", f"folder={tmp_path}", f"hydra.run.dir={tmp_path}/run")
    assert stopped.value.code == 2 and "made with another" in capsys.readouterr().err
