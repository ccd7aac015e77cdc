"""Flights stay where they are asked to, or the sequence is refused."""

from __future__ import annotations

import numpy as np
import pytest
from support.dataset_configs import config_of

from aerojax.capture.format import CaptureCamera
from aerojax.core.errors import UserError
from aerojax.simulate.plan.dataset import work_list
from aerojax.simulate.plan.planner import plan_sequence
from aerojax.simulate.world.rigs import cameras_that_see


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


def test_objects_pass_each_other_and_hide_each_other(monkeypatch, tmp_path):
    monkeypatch.setattr("aerojax.simulate.plan.scene.build_identity", lambda identity, folder: folder / identity.name)
    crowd = "crowd={objects: 2, most_objects: 4, birds: 1, crossings: 1, occlusions: 1}"
    config = config_of("rig=sim2", "preset=full", crowd, "rig.environment=sky", "rig.max_acceleration=15")
    counts = set()
    for task in work_list(config)[:8]:
        plan = plan_sequence(task, config, tmp_path)
        counts.add(len(plan.objects))
        change = [np.diff(one.flight.position, 2, axis=0) * plan.fps**2 for one in plan.objects]
        assert max(np.linalg.norm(one, axis=1).max() for one in change) < 15.0
        first, second, third = (plan.shown(one.flight).position for one in plan.objects[:3])
        assert 2.0 < np.linalg.norm(second - first, axis=1).min() < 3.0
        apart = [_least_angle(third, other, camera) for camera in plan.cameras for other in (first, second)]
        assert min(apart) < 0.01  # radians: the size of an object at 100 m
    assert counts <= {3, 4, 5} and len(counts) > 1


def _least_angle(behind: np.ndarray, before: np.ndarray, camera: CaptureCamera) -> float:
    """Between one path, where it is farther from the camera, and another."""
    rays = [path - camera.world_from_cam[:3, 3] for path in (behind, before)]
    far = np.linalg.norm(rays[0], axis=1) > np.linalg.norm(rays[1], axis=1)
    units = [ray / np.linalg.norm(ray, axis=1, keepdims=True) for ray in rays]
    return float(np.linalg.norm(units[0] - units[1], axis=1)[far].min(initial=np.inf))


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
        (("crowd.objects=3", "crowd.most_objects=2"), "crowd.most_objects is 2; use crowd.objects or more"),
        (("crowd.objects=2", "crowd.crossings=2"), "crowd.crossings and crowd.occlusions are 2 and 0; use 0 to 1"),
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
