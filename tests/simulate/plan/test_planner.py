"""One planner: everything follows from seed and name, calibration is as wrong as asked, samples are scenes too."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.dataset_configs import config_of

from aerojax.simulate.assets.catalogue import identities
from aerojax.simulate.plan.dataset import FaultConfig, work_list
from aerojax.simulate.plan.planner import SequenceConfig, perturbed_calibration, plan_sample, plan_sequence
from aerojax.simulate.render.environment import Dome
from aerojax.simulate.world.fixed_rigs import Condition, FixedRigConfig, place_cameras


def test_sequences_follow_from_seed_and_name(monkeypatch, tmp_path):
    monkeypatch.setattr("aerojax.simulate.plan.scene.build_identity", lambda identity, folder: folder / identity.name)
    config = config_of("rig=sim1", "preset=smoke")
    first, second = work_list(config)[:2]
    one, again, other = (plan_sequence(t, config, tmp_path) for t in (first, first, second))
    np.testing.assert_array_equal(one.objects[0].flight.world_from_body, again.objects[0].flight.world_from_body)
    assert isinstance(one.environment, Dome) and one.environment.light == again.environment.light
    assert one.objects[0].phase != other.objects[0].phase
    reseeded = plan_sequence(first, replace(config, seed=1), tmp_path)
    assert one.objects[0].phase != reseeded.objects[0].phase
    assert not one.objects[0].flight.position.any()  # in place, at the centre


def test_perturbed_calibration_is_as_wrong_as_asked():
    camera = place_cameras(FixedRigConfig("sphere", 3, 64, 48, 100.0, radii=(5.0,)), Condition("", 5.0, 0.0))[0]
    rng = np.random.default_rng(0)
    assert perturbed_calibration(camera, FaultConfig(), rng).world_from_cam.tolist() == camera.world_from_cam.tolist()
    told = [perturbed_calibration(camera, FaultConfig(0.5, 0.02, 1.0), rng) for _ in range(300)]
    true = Rotation.from_matrix(camera.world_from_cam[:3, :3])
    turns = [np.rad2deg((true.inv() * Rotation.from_matrix(t.world_from_cam[:3, :3])).magnitude()) for t in told]
    shifts = np.stack([t.world_from_cam[:3, 3] - camera.world_from_cam[:3, 3] for t in told])
    assert np.sqrt(np.mean(np.square(turns))) == pytest.approx(0.5, rel=0.15)
    assert shifts.std() == pytest.approx(0.02, rel=0.1)
    assert np.std([t.K[0, 0] for t in told]) == pytest.approx(1.0, rel=0.15)
    assert all(t.K[0, 0] == t.K[1, 1] for t in told)


@pytest.mark.parametrize("white", [True, False])
def test_samples_are_scenes_with_one_object(white, monkeypatch, tmp_path):
    monkeypatch.setattr("aerojax.simulate.plan.scene.build_identity", lambda identity, folder: folder / identity.name)
    (identity,) = (i for i in identities("test", 1) if i.label == "drone")
    config = SequenceConfig(frames=5, depth=False, white_dome=white)
    one, again, other = (plan_sample(identity, config, seed=s, assets=tmp_path) for s in (1, 1, 2))
    (flown,) = one.objects
    assert (flown.identity, flown.asset, one.frames, one.margin) == (identity, tmp_path / identity.name, 5, 0)
    assert one.calibration == one.cameras and {c.depth for c in one.cameras} == {None}
    assert all(c.mask and not c.coverage for c in one.cameras)
    assert isinstance(one.environment, Dome) and len(one.environment.by_camera) == (0 if white else len(one.cameras))
    np.testing.assert_array_equal(flown.flight.transforms(), again.objects[0].flight.transforms())
    assert flown.phase == again.objects[0].phase != other.objects[0].phase
    # A flight of at most 4 m about its middle frame, 6 to 14 m high.
    assert 6.0 <= flown.flight.position[2, 2] <= 14.0 and np.ptp(flown.flight.position, axis=0).max() <= 4.0
