"""Rows and conditions of eval_reconstructor: names, changed masks, degenerate crops, sheets."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from support.view_sets import ball_scenes

from aerojax.core.errors import UserError
from aerojax.reconstruct.fit.optimise import GaussianFitConfig
from experiments._benchmarks.reconstruction_scenes import ConditionsConfig, conditions
from experiments._benchmarks.reconstruction_sheet import HEADING, condition_table, write_sheet
from experiments._benchmarks.reconstructors import cost_row, entrants, measured, with_masks

SCENES = ball_scenes(2)
FIT = GaussianFitConfig(steps=2, report_every=2)


def test_masks_are_changed_as_they_are_called():
    whole = SCENES.mask.astype(int)
    none, grown, shrunk, empty = (
        with_masks(SCENES, name).mask.astype(int) for name in ("none", "grown", "shrunk", "empty")
    )
    assert (none == 255).all() and not empty[:, 0].any() and (empty[:, 1:] == whole[:, 1:]).all()
    assert (grown >= whole).all() and (shrunk <= whole).all()
    assert (grown > 127).sum() > (whole > 127).sum() > (shrunk > 127).sum() > 0
    with pytest.raises(UserError, match="masks: unknown name 'holes'"):
        with_masks(SCENES, "holes")


def test_rows_are_members_the_fit_and_nothing_else():
    rows = entrants(("constant", "hull", "fit"), (), FIT, seed=0)
    assert [row.name for row in rows] == ["constant", "hull", "fit"] and all(row.parameters == 0 for row in rows)
    with pytest.raises(UserError, match="entrants: unknown name 'hall'"):
        entrants(("hall",), (), FIT, seed=0)
    told = []
    figures, pictures = measured(rows[0], SCENES, None, lambda: told.append(1))
    assert (
        len(told) == 2
        and [row["name"] for row in figures] == ["ball_0", "ball_1"]
        and pictures[0].shape == (3, 32, 32, 3)
    )
    assert figures[0]["distance_m"] == pytest.approx(3.0) and figures[0]["cameras"] == 4
    cost = cost_row(rows[0], SCENES, cameras=4, repeats=1)
    assert cost["ms"] > 0 and cost_row(rows[2], SCENES, cameras=4, repeats=1)["ms"] is None


def test_conditions_say_where_a_crop_is_degenerate(tmp_path):
    config = ConditionsConfig(identities=0, swept=1, contexts=(), masks=(), distances=(32.0, 280.0), rigs=("line",))
    found = [(one.factor, one.value) for one in conditions(config, tmp_path, seed=0)]
    assert found == [
        ("distance", "32 m"),
        ("distance", "280 m (degenerate crop)"),
        ("rig", "line"),
        ("calibration", "line 0.3 deg"),
    ]


def test_a_sheet_shows_targets_and_members_side_by_side(tmp_path):
    pictures = [np.zeros((3, 32, 32, 3), np.float32)] * 2
    write_sheet(tmp_path / "sheet.png", SCENES, {"a": pictures, "b": pictures}, most=1)
    sheet = cv2.imread(str(tmp_path / "sheet.png"))
    assert sheet.shape == (HEADING + 32, 96, 3) and sheet[HEADING:, :32].max() > 200 and not sheet[HEADING:, 32:].any()
    rows = [{"member": "a", "psnr_db": 20.123, "gaussians": 100.0}]
    table = condition_table("protocol", rows)
    assert [c.header for c in table.columns] == ["member", "PSNR on it", "Gaussians"] and table.row_count == 1
