"""Contact sheets and the measure of the colour leak, at their smallest."""

from __future__ import annotations

import json

import cv2
import pytest
from support.command_line import run_command

from aerojax.simulate.assets.catalogue import identities
from aerojax.simulate.render.contact_sheet import CAPTION
from experiments import draw_contact_sheets, measure_colour_leak


def test_a_sheet_shows_every_identity(tmp_path, monkeypatch):
    where = (f"out={tmp_path}/sheets", f"assets={tmp_path}/assets", f"hydra.run.dir={tmp_path}/run")
    run_command(draw_contact_sheets, monkeypatch, "preset=smoke", "splits=[test]", "labels=[helicopter]", *where)
    sheet = cv2.imread(str(tmp_path / "sheets/helicopter.jpg"))
    count = sum(i.label == "helicopter" for i in identities("test"))
    rows = -(-count // 4)
    assert sheet.shape == (rows * (48 + CAPTION + 4), 4 * (2 * 64 + 4), 3)
    for column in range(min(count, 4)):
        assert sheet[:48, column * 132 : (column + 1) * 132].std() > 5


@pytest.mark.slow
def test_the_leak_is_reported(tmp_path, monkeypatch):
    where = (f"assets={tmp_path}/assets", f"hydra.run.dir={tmp_path}/run")
    run_command(measure_colour_leak, monkeypatch, "preset=smoke", *where)
    results = json.loads((tmp_path / "run/results.json").read_text())
    assert results["identities"] == {"train": 4, "test": 4}
    for light in ("albedo", "lit"):
        for name in ("nearest_neighbours", "ridge"):
            found = results[f"{light}_{name}"]
            assert 0 <= found["balanced"] <= 1 and found["interval"][0] <= found["chance"] <= found["interval"][1]
