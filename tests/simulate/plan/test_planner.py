"""What a data set consists of: Table 6.3 of the thesis, camera networks, placements, and refusals."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hydra import compose, initialize_config_dir
from hydra.core.global_hydra import GlobalHydra
from omegaconf import OmegaConf
from scipy.spatial.transform import Rotation

from aerojax.core.config import to_dataclass
from aerojax.core.errors import UserError
from aerojax.geometry.cameras import project_points
from aerojax.simulate.plan.dataset import DatasetConfig, FaultConfig, count, fixed_rig, work_list
from aerojax.simulate.plan.planner import perturbed_calibration, plan_sequence
from aerojax.simulate.plan.sizes import estimated_bytes
from aerojax.simulate.render.environment import Dome
from aerojax.simulate.world.fixed_rigs import Condition, FixedRigConfig, conditions, place_cameras
from aerojax.simulate.world.rigs import cameras_that_see
from experiments.generate_dataset import Config, plain

CONF = Path(__file__).resolve().parents[3] / "conf"
IDENTITIES = {
    "bird": {"train": 15, "val": 6, "test": 8},
    "drone": {"train": 15, "val": 7, "test": 8},
    "helicopter": {"train": 8, "val": 4, "test": 4},
    "airplane": {"train": 8, "val": 4, "test": 4},
}
TABLE = {  # thesis Table 6.3: assets, sequences, frames
    "sim1": {"train": (46, 920, 27600), "val": (21, 420, 12600), "test": (24, 480, 14400)},
    "sim2": {"train": (46, 92, 8280), "val": (21, 42, 3780), "test": (24, 48, 4320)},
    "sim3": {"test": (24, 24, 2880)},
}


def config_of(*overrides: str) -> DatasetConfig:
    GlobalHydra.instance().clear()
    with initialize_config_dir(str(CONF), version_base="1.3"):
        values = OmegaConf.to_container(compose("generate_dataset", list(overrides)), resolve=True)
    return plain(to_dataclass(values, Config))  # type: ignore[arg-type]


@pytest.mark.parametrize("rig", TABLE)
def test_full_presets_are_table_6_3(rig):
    config = config_of(f"rig={rig}", "preset=full")
    tasks = work_list(config)
    for split, (assets, sequences, frames) in TABLE[rig].items():
        mine = [task for task in tasks if task.identity.split == split]
        assert (len({t.identity.name for t in mine}), len(mine), len(mine) * config.frames) == (
            assets,
            sequences,
            frames,
        )
        each = sequences // assets * config.frames
        by_class = Counter(task.identity.label for task in mine)
        assert {c: n * config.frames for c, n in by_class.items()} == {
            c: n[split] * each for c, n in IDENTITIES.items()
        }
    assert {task.identity.split for task in tasks} == set(TABLE[rig])
    assert len({task.name for task in tasks}) == len(tasks)


@pytest.mark.parametrize("rig", ["sim1", "sim2", "sim3", "random"])
@pytest.mark.parametrize("preset", ["smoke", "small", "full"])
def test_every_preset_has_work_and_a_size(rig, preset):
    config = config_of(f"rig={rig}", f"preset={preset}")
    tasks = work_list(config)
    counts = count(config, tasks)
    assert counts.sequences == len(tasks) and counts.frames == len(tasks) * config.frames
    assert counts.images >= 3 * counts.frames and estimated_bytes(config, tasks) > 1000 * counts.images
    if preset == "small":
        # The test identities alone, and three individuals of each family before random networks.
        assert counts.identities == {"sim3": 24, "random": 3 * 91}.get(rig, 91) and config.frames >= 8


def test_sim1_is_the_published_sweep():
    rig = fixed_rig(config_of("rig=sim1", "preset=full"))
    assert [(c.radius, c.elevation_deg) for c in conditions(rig)][:3] == [(2, -20), (2, 20), (4, -20)]
    assert len(conditions(rig)) == 20
    for condition in conditions(rig):
        cameras = place_cameras(rig, condition)
        centres = np.stack([camera.world_from_cam[:3, 3] for camera in cameras])
        np.testing.assert_allclose(np.linalg.norm(centres, axis=1), condition.radius)
        np.testing.assert_allclose(np.rad2deg(np.arcsin(centres[:, 2] / condition.radius)), condition.elevation_deg)
        azimuth = np.rad2deg(np.arctan2(centres[:, 1], centres[:, 0])) % 360
        np.testing.assert_allclose(azimuth, [45, 135, 225, 315])
        for camera in cameras:
            np.testing.assert_allclose(project_points(np.zeros((1, 3)), camera)[0], [1280, 720], atol=1e-9)
    assert rig.focal_px == pytest.approx(10 * 128 / np.tan(np.deg2rad(49.1 / 2)), rel=1e-4)


def test_sim2_is_a_circle_that_looks_down():
    rig = fixed_rig(config_of("rig=sim2", "preset=full"))
    (condition,) = conditions(rig)
    centres = np.stack([c.world_from_cam[:3, 3] for c in place_cameras(rig, condition)])
    np.testing.assert_allclose(np.hypot(centres[:, 0], centres[:, 1]), 100.0)
    np.testing.assert_allclose(centres[:, 2], 37.0)
    assert len(centres) == 5 and rig.aim[2] == 37.0 - 15.0
    assert 2 * np.rad2deg(np.arctan(720 / rig.focal_px)) == pytest.approx(30.0, abs=0.01)


def test_sim3_is_a_line_of_fifty_metres():
    rig = fixed_rig(config_of("rig=sim3", "preset=full"))
    centres = np.stack([c.world_from_cam[:3, 3] for c in place_cameras(rig, conditions(rig)[0])])
    assert np.linalg.norm(centres[0] - centres[-1]) == pytest.approx(50.0)
    np.testing.assert_allclose(centres[:, 2], 8.0)
    assert np.linalg.matrix_rank(centres - centres[0], tol=1e-9) == 1 and len(centres) == 5


def test_cameras_that_see_counts_whole_balls():
    rig = FixedRigConfig("sphere", 4, 200, 100, 100.0, radii=(10.0,))
    cameras = place_cameras(rig, Condition("", 10.0, 0.0))
    points = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 4.0], [0.0, 0.0, 4.6], [-60.0, 0.0, 0.0]])
    # At 10 m half the height is 5 m; from 70 m everything near the axis is in sight of the one camera that faces it.
    assert cameras_that_see(points, cameras, 0.5).tolist() == [4, 4, 0, 1]


@pytest.mark.parametrize("rig", ["sim2", "sim3"])
def test_flights_stay_in_the_volume_in_sight_and_apart(rig, monkeypatch, tmp_path):
    monkeypatch.setattr("aerojax.simulate.plan.scene.build_identity", lambda identity, folder: folder / identity.name)
    config = config_of(f"rig={rig}", "preset=full", "crowd.objects=2", "crowd.birds=1", "rig.environment=sky")
    for task in work_list(config)[:6]:
        plan = plan_sequence(task, config, tmp_path)
        assert plan.objects[0].identity == task.identity and len({a.identity.name for a in plan.objects}) == 3
        assert {a.identity.split for a in plan.objects} == {task.identity.split}
        assert sum(a.identity.label == "bird" for a in plan.objects) >= 1
        for number, flown in enumerate(plan.objects):
            path = flown.flight.position
            assert len(path) == plan.frames + 2 * plan.margin
            assert config.rig.volume.contains(path)
            assert cameras_that_see(path, plan.cameras).min() >= 3
            for other in plan.objects[:number]:
                assert np.linalg.norm(path - other.flight.position, axis=1).min() > 2.0


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


def test_misstated_calibration_is_as_wrong_as_asked():
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


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        (("frames=0",), "frames is 0; a sequence needs at least 1"),
        (("fps=0.0",), "fps is 0"),
        (("sequences.train=-1",), "sequences is negative"),
        (("+sequences.extra=1",), "sequences has .*extra.*use train, val, test"),
        (("sequences={train: 0, val: 0, test: 0}",), "the data set would be empty"),
        (("radii=[3]",), r"radii is \[3.0\]; choose among \[2.0, 4.0"),
        (("crowd.objects=0",), "crowd.objects is 0"),
        (("crowd.birds=-1",), "crowd.birds is -1"),
        (("faults.position_m=-0.1",), "faults has a negative size"),
        (("randomisation=2.0",), "randomisation is 2"),
        (("images.samples=0",), "images.samples is 0"),
        (("rig.fixed.cameras=2",), "at least 3"),
        (("classes=[ufo]",), "classes has .*ufo"),
    ],
)
def test_nonsense_is_refused(overrides, words):
    with pytest.raises(UserError, match=words):
        work_list(config_of("rig=sim1", "preset=small", *overrides))


def test_a_volume_that_nobody_sees_is_refused(tmp_path):
    config = config_of("rig=sim2", "preset=smoke", "rig.volume={low: [-5, -5, 200], high: [5, 5, 220]}")
    with pytest.raises(UserError, match=r"rig sim2: no .* flight .* lower rig.max_travel"):
        plan_sequence(work_list(config)[0], config, tmp_path)
