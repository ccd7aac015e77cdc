"""`python -m experiments.import_models`, whole: a list in; stages, a picture and figures out; mistakes end it."""

from __future__ import annotations

import json

import cv2
import pytest
from support.command_line import run_command
from support.gltf_files import triangle

from experiments import import_models


def test_models_are_converted_and_drawn(tmp_path, monkeypatch):
    triangle().write(tmp_path / "a.glb")
    models = tmp_path / "models.yaml"
    models.write_text("models:\n  - {name: kite, file: a.glb, class: bird, forward: +Z, up: +Y}\n")
    where = (f"hydra.run.dir={tmp_path}/run", f"out={tmp_path}/out", f"assets={tmp_path}/assets")
    run_command(import_models, monkeypatch, "preset=smoke", f"models={models}", *where)
    metrics = json.loads((tmp_path / "run/metrics.json").read_text())
    assert metrics == {"kite": {"size_m": [0.0, 1.0, 0.5], "faces": 1, "cycle_seconds": 0.0}}
    assert (tmp_path / "assets/kite.usdc").is_file()
    picture = cv2.imread(str(tmp_path / "out/models.jpg"))
    assert picture is not None and picture.std() > 5


def test_mistakes_of_the_list_end_the_run(tmp_path, monkeypatch, capsys):
    models = tmp_path / "models.yaml"
    models.write_text("models:\n  - {name: kite, file: none.glb, class: bird}\n")
    with pytest.raises(SystemExit) as ended:
        run_command(import_models, monkeypatch, f"models={models}", f"hydra.run.dir={tmp_path}/run")
    assert ended.value.code == 2
    assert "models[0] (kite): file:" in capsys.readouterr().err
