"""Levels differ by their fault alone; clips of a folder are gone on with, and what cannot be had is remembered."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.factory_configs import small_factory

from aerojax.core.errors import UserError
from aerojax.data.clips import load_clip
from aerojax.pipeline.factory.levels import BASE, NO_FAULTS, CurveLevels, LevelsConfig, levels_of, names_of
from aerojax.pipeline.factory.paired import make_levels
from aerojax.pipeline.factory.plan import plan_clip
from aerojax.pipeline.factory.write import individuals_of
from aerojax.simulate.assets.animated import build_animated

DEFAULTS = LevelsConfig()
SMALL = LevelsConfig(
    factory=small_factory(split="test", faults=NO_FAULTS),
    curves=CurveLevels((), (33.0,), (-60, 0), (4, 3), (), (), ()),
)


@pytest.mark.parametrize("number", range(4))
def test_only_the_fault_differs(number):
    identity = individuals_of(DEFAULTS.factory)[number]
    mesh = build_animated(identity)
    plans = {
        level.folder: (level, plan_clip(identity, mesh, "one", 0, level.config, least_margin=DEFAULTS.margin))
        for level in levels_of(DEFAULTS)
    }
    ideal = plans[BASE][1]
    places = {camera.name: camera.world_from_cam for camera in ideal.cameras}
    for level, plan in plans.values():
        np.testing.assert_array_equal(plan.flight.position, ideal.flight.position)
        np.testing.assert_array_equal(plan.flight.world_from_body, ideal.flight.world_from_body)
        same = ("phase", "fps", "motion", "environment", "noise_seed", "kind", "margin")
        assert [getattr(plan, name) for name in same] == [getattr(ideal, name) for name in same]
        for camera in plan.cameras if level.factor != "distance_m" else ():
            np.testing.assert_array_equal(camera.world_from_cam, places[camera.name])
    fewest, combined = plans["cameras_3"][1], plans["combined_0.3_10_1"][1]
    assert len(fewest.cameras) == 3 and len(combined.cameras) == 7
    assert {camera.name for camera in combined.cameras} == {camera.name for camera in plans["cameras_7"][1].cameras}
    wrong = [camera.world_from_cam for camera in plans["calibration_deg_2"][1].calibration]
    assert not np.allclose(wrong, list(places.values()), atol=1e-3)


def test_distance_leaves_the_cameras_as_they_are():
    identity = individuals_of(DEFAULTS.factory)[0]
    mesh = build_animated(identity)
    plans = [
        plan_clip(identity, mesh, "one", 0, level.config, least_margin=DEFAULTS.margin)
        for level in levels_of(DEFAULTS)
        if level.factor == "distance_m"
    ]
    focal = np.array([[camera.K[0, 0] for camera in plan.cameras] for plan in plans])
    np.testing.assert_allclose(focal, focal[:1].repeat(4, axis=0), rtol=0.05)  # perspective widens what is near
    away = [np.median([np.linalg.norm(c.world_from_cam[:3, 3]) for c in plan.cameras]) for plan in plans]
    assert 200 < away[-1] < 320 and away[-1] > 10 * away[0]


def test_levels_that_change_nothing_share_a_folder():
    found = levels_of(DEFAULTS)
    shared = {(level.factor, level.value) for level in found if level.folder == BASE}
    assert shared == {
        (BASE, 0.0),
        ("calibration_deg", 0.0),
        ("clock_ms", 0.0),
        ("mask_growth", 0.0),
        ("cameras", 8.0),
        ("width_px", 80.0),
    }
    assert len({level.folder for level in found}) == 32


def test_levels_that_cannot_be_are_refused():
    with pytest.raises(UserError, match=r"curves.cameras is \[9\]"):
        levels_of(LevelsConfig(curves=CurveLevels(cameras=(9,))))
    with pytest.raises(UserError, match=r"curves.combined is \[1.0\]"):
        levels_of(LevelsConfig(curves=CurveLevels(combined=(1.0,))))


@pytest.mark.slow
def test_a_folder_of_levels(tmp_path):
    made = make_levels(SMALL, tmp_path, workers=1, progress=lambda *_: None)
    names = sorted(name for name, _ in names_of(SMALL))
    assert made.new == 12 and made.undrawn == {
        BASE: (),
        "clock_ms_33": (),
        "mask_growth_-60": tuple(names),
        "cameras_3": (),
    }
    for name in names:
        stored = {level: load_clip(tmp_path / level / "test" / f"{name}.npz") for level in (BASE, "cameras_3")}
        assert stored[BASE].facts["cameras"] == 4 and stored["cameras_3"].facts["cameras"] == 3
        assert stored[BASE].facts["attempt"] == stored["cameras_3"].facts["attempt"]
    lost = tmp_path / "cameras_3" / "test" / f"{names[0]}.npz"
    before = lost.read_bytes()
    lost.unlink()
    again = make_levels(SMALL, tmp_path, workers=1, progress=lambda *_: None)
    assert (again.new, again.undrawn) == (1, made.undrawn) and lost.read_bytes() == before
    slower = replace(SMALL, curves=replace(SMALL.curves, clock_ms=(99.0,)))
    with pytest.raises(UserError, match="another margin"):
        make_levels(slower, tmp_path, workers=1, progress=lambda *_: None)
