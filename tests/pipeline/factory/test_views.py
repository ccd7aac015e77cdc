"""Scenes for reconstructors: the same from the same name, their targets agree with their views, shards are whole."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aerojax.core.errors import UserError
from aerojax.data.views import ARRAYS, load_views, stacked
from aerojax.pipeline.factory.config import RigRanges
from aerojax.pipeline.factory.views import SOLID, ViewsConfig, fibonacci_directions, objects_of, scenes_of
from aerojax.pipeline.factory.write_views import SHARD, make_views

CONFIG = ViewsConfig(objects=2, poses=1, targets=3, size=32, rigs=RigRanges(cameras=(4, 4), width_px=(40.0, 60.0)))


@pytest.fixture(scope="module")
def scenes():
    return stacked([scene for one in objects_of(CONFIG) for scene in scenes_of(one, CONFIG)])


def test_half_of_the_objects_are_solids_and_more_extend_the_list():
    few, many = objects_of(replace(CONFIG, objects=6)), objects_of(replace(CONFIG, objects=10))
    assert many[:6] == few and [one.label == SOLID for one in many].count(True) == 5
    assert all(one.label != SOLID for one in objects_of(replace(CONFIG, objects=5, solids=0.0)))
    test = objects_of(replace(CONFIG, split="test", objects=6))
    assert not {one.name for one in test} & {one.name for one in many}


def test_a_name_is_a_scene(scenes):
    (again,) = scenes_of(objects_of(CONFIG)[1], CONFIG)
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(scenes, name)[1], again[name])
    assert scenes.kind[1] == SOLID and scenes.valid.sum(axis=1).tolist() == [4, 4]
    assert ((scenes.width_px > 20) & (scenes.width_px < 120)).all()


def test_what_targets_see_lies_in_every_mask(scenes):
    """Depth, coverage, cameras and frame of the targets agree with the views', whose calibration is a little wrong."""
    for scene in range(len(scenes)):
        for target in range(3):
            mask, K, pose = (getattr(scenes, f"target_{n}")[scene, target] for n in ("mask", "K", "world_from_cam"))
            rows, columns = np.nonzero(mask > 250)
            depth = scenes.target_relief[scene, target][rows, columns] + np.linalg.norm(pose[:3, 3])
            pixels = np.stack([columns + 0.5, rows + 0.5, np.ones(len(rows))], axis=1)
            points = (pixels @ np.linalg.inv(K).T * depth[:, None]) @ pose[:3, :3].T + pose[:3, 3]
            for view in np.flatnonzero(scenes.valid[scene]):
                camera = scenes.world_from_cam[scene, view]
                inside = (points - camera[:3, 3]) @ camera[:3, :3]
                at = inside @ scenes.K[scene, view].T
                column, row = np.clip((at[:, :2] / at[:, 2:]).astype(int), 0, 31).T
                near = [
                    scenes.mask[scene, view][np.clip(row + i, 0, 31), np.clip(column + j, 0, 31)]
                    for i in (-1, 0, 1)
                    for j in (-1, 0, 1)
                ]
                assert np.mean(np.max(near, axis=0) > 127) > 0.9


def test_fibonacci_directions_are_even():
    away = fibonacci_directions(50)
    np.testing.assert_allclose(np.linalg.norm(away, axis=1), 1.0)
    nearest = np.sort(np.arccos(np.clip(away @ away.T, -1, 1)), axis=1)[:, 1]
    assert nearest.min() > 0.6 * nearest.max()


def test_shards_are_made_once(tmp_path):
    config = replace(CONFIG, objects=1, solids=1.0, targets=1, size=16, attempts=2)
    told = []
    made = make_views(config, tmp_path, workers=1, progress=lambda *row: told.append(row))
    assert (
        made.objects == SHARD and told[-1][:2] == (SHARD, SHARD) and len(load_views([tmp_path / "train"])) == made.new
    )
    before = (tmp_path / "train" / "views_00000.npz").read_bytes()
    assert make_views(config, tmp_path, workers=1, progress=lambda *row: None).new == 0
    assert (tmp_path / "train" / "views_00000.npz").read_bytes() == before
    with pytest.raises(UserError, match="made with another size"):
        make_views(replace(config, size=24), tmp_path, workers=1, progress=lambda *row: None)


def test_wrong_ranges_are_refused():
    for change in ({"objects": 0}, {"size": 8}, {"solids": 1.5}):
        with pytest.raises(UserError) as error:
            replace(CONFIG, **change)
        assert error.value.code == "out-of-range"
