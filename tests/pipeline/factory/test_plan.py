"""A planned clip: the rig that was asked for, the drawn width, faults where they belong, the same again."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from support.factory_configs import IDEAL, small_factory

from aerojax.geometry.boxes import projected_box
from aerojax.pipeline.factory.config import KINDS, FactoryConfig, RigRanges
from aerojax.pipeline.factory.plan import ClipPlan, plan_clip, rig_kind
from aerojax.simulate.assets.animated import build_animated
from aerojax.simulate.assets.catalogue import identities
from aerojax.simulate.usd.animated_mesh import AnimatedMesh

DRONE = identities("train")[1]


@lru_cache
def mesh() -> AnimatedMesh:
    return build_animated(DRONE)


def planned(config: FactoryConfig, name: str = "one", attempt: int = 0) -> ClipPlan:
    return plan_clip(DRONE, mesh(), name, attempt, config)


@pytest.mark.parametrize("kind", KINDS)
def test_cameras_stand_and_zoom_as_drawn(kind):
    rigs = RigRanges(kinds=(kind,), cameras=(5, 5), width_px=(40.0, 40.0), distance_m=(64.0, 64.0))
    plan = planned(small_factory(rigs=rigs, faults=IDEAL))
    target = plan.flight.position[1 + 1]
    centres = np.stack([camera.world_from_cam[:3, 3] for camera in plan.cameras])
    assert len(centres) == 5 and plan.kind == kind
    assert np.median(np.linalg.norm(centres - target, axis=1)) == pytest.approx(64.0, rel=0.03)
    middle = mesh().vertices_at(plan.phase + 1 / plan.fps).astype(np.float64) + target
    boxes = [projected_box(middle, camera) for camera in plan.cameras]
    sides = [max(box[2] - box[0], box[3] - box[1]) for box in boxes if box is not None]
    assert np.median(sides) == pytest.approx(40.0, rel=0.1)
    if kind == "line":
        assert np.linalg.matrix_rank(centres - centres[0], tol=1e-6) == 1
    if kind in ("circle", "line"):
        np.testing.assert_allclose(centres[:, 2], centres[0, 2])


def test_faults_are_those_that_were_drawn():
    exact = planned(small_factory(faults=IDEAL))
    for stands, stated in zip(exact.cameras, exact.calibration, strict=True):
        assert stands.time_offset_s == 0.0
        np.testing.assert_array_equal(stands.world_from_cam, stated.world_from_cam)
    faults = replace(IDEAL, rotation_deg=(1.0, 1.0), clock_ms=(33.0, 33.0), lost=(1, 1), mask_growth=(2, 2))
    wrong = planned(small_factory(faults=faults))
    assert (wrong.faults.rotation_deg, wrong.faults.lost, wrong.faults.mask_growth) == (1.0, 1, 2)
    assert len(wrong.cameras) == len(wrong.calibration) == 3
    offsets = [camera.time_offset_s for camera in wrong.cameras]
    assert 0.0 < max(map(abs, offsets)) <= 0.033 and len(set(offsets)) == 3
    for stands, stated in zip(wrong.cameras, wrong.calibration, strict=True):
        cosine = (np.trace(stands.world_from_cam[:3, :3].T @ stated.world_from_cam[:3, :3]) - 1) / 2
        assert 0.0 < np.degrees(np.arccos(min(cosine, 1.0))) < 4.0
        np.testing.assert_array_equal(stands.world_from_cam[:3, 3], stated.world_from_cam[:3, 3])


def test_a_clip_follows_from_its_name_and_attempt():
    config = small_factory(rigs=RigRanges())
    one, again = planned(config), planned(config)
    np.testing.assert_array_equal(one.flight.position, again.flight.position)
    assert one.faults == again.faults and one.kind == again.kind == rig_kind(config, "one")
    assert not np.array_equal(one.cameras[0].K, planned(config, "two").cameras[0].K)
    assert not np.array_equal(one.cameras[0].K, planned(config, attempt=1).cameras[0].K)
    assert planned(config, attempt=1).kind == one.kind
