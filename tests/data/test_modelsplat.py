"""ModelSplat's layout, written here: lists, splits, versions, the unit ball; every refusal is named."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from aerojax.core.errors import UserError
from aerojax.core.types import CLASSES, Gaussians
from aerojax.data.clips import load_clip, load_clips
from aerojax.data.imports.modelsplat import (
    MODELNET_10,
    MODELNET_40,
    ObjectReading,
    find_objects,
    import_objects,
    in_unit_ball,
    object_columns,
)
from aerojax.gaussians.decimate import DecimationConfig
from aerojax.gaussians.io.ply import write_ply

READING = ObjectReading(versions=3, validation=0.0, decimation=DecimationConfig(draw=64, farthest=40, keep=32))
NAMES = {"train": ("chair_0001", "night_stand_0001", "night_stand_0002"), "test": ("chair_0890",)}


def gaussians_of(count: int, seed: int = 0) -> Gaussians:
    rng = np.random.default_rng(seed)
    columns = rng.uniform(0.1, 0.9, (count, 14))
    columns[:, :3] += (5.0, -3.0, 2.0)
    return Gaussians.from_columns(jnp.asarray(columns, jnp.float32))


@pytest.fixture
def root(tmp_path):
    """Objects as ShapeSplat unpacks them, and the official lists beside them."""
    for part, names in NAMES.items():
        for number, name in enumerate(names):
            write_ply(
                tmp_path / "gs" / name.rpartition("_")[0] / part / name / "point_cloud.ply", gaussians_of(50, number)
            )
        (tmp_path / f"modelnet10_{part}.txt").write_text("".join(name + "\n" for name in names[-2:]))
    return tmp_path


def test_the_classes_are_those_of_modelnet():
    assert len(MODELNET_10) == 10 and len(MODELNET_40) == 40 and set(MODELNET_10) < set(MODELNET_40)
    assert tuple(sorted(MODELNET_40)) == MODELNET_40 and tuple(sorted(MODELNET_10)) == MODELNET_10


def test_folders_or_lists_say_what_there_is(root):
    found = find_objects(root / "gs", READING)
    assert [(one.name, one.label, one.split) for one in found] == [
        ("chair_0001", "chair", "train"),
        ("chair_0890", "chair", "test"),
        ("night_stand_0001", "night_stand", "train"),
        ("night_stand_0002", "night_stand", "train"),
    ]
    listed = find_objects(root / "gs", READING, lists=root)
    assert [one.name for one in listed] == ["chair_0890", "night_stand_0001", "night_stand_0002"]


def test_a_share_of_the_training_objects_chooses_the_weights(root):
    half = ObjectReading(validation=0.5)
    splits = {one.name: one.split for one in find_objects(root / "gs", half)}
    assert splits["chair_0890"] == "test" and set(splits.values()) <= {"train", "val", "test"}
    many = [f"chair_{number:04d}" for number in range(400)]
    for name in many:
        (root / "gs/chair/train" / name).mkdir(exist_ok=True)
        (root / "gs/chair/train" / name / "point_cloud.ply").touch()
    chosen = [one.name for one in find_objects(root / "gs", half) if one.split == "val"]
    assert 150 < len(chosen) < 250
    assert [one.name for one in find_objects(root / "gs", half) if one.split == "val"] == chosen


def test_the_unit_ball_keeps_the_shape():
    columns = np.asarray(gaussians_of(30).columns())
    ball = in_unit_ball(columns)
    np.testing.assert_allclose(ball[:, :3].mean(axis=0), 0.0, atol=1e-6)
    assert np.linalg.norm(ball[:, :3], axis=1).max() == pytest.approx(1.0, abs=1e-6)
    radius = np.linalg.norm(columns[:, :3] - columns[:, :3].mean(axis=0), axis=1).max()
    np.testing.assert_allclose(ball[:, 7:10] * radius, columns[:, 7:10], rtol=1e-5)
    np.testing.assert_array_equal(ball[:, [3, 4, 5, 6, 10, 11, 12, 13]], columns[:, [3, 4, 5, 6, 10, 11, 12, 13]])


def test_versions_are_different_subsets_of_one_object():
    gaussians = gaussians_of(100)
    versions = object_columns(gaussians, 3, READING.decimation, key=jax.random.key(1))
    assert versions.shape == (3, 32, 14)
    known = {tuple(row) for row in in_unit_ball(np.asarray(gaussians.columns()))}
    assert all(tuple(row) in known for row in versions.reshape(-1, 14))
    assert len({frozenset(map(tuple, version)) for version in versions}) == 3


def test_clips_carry_their_own_classes(root, tmp_path):
    out = tmp_path / "clips"

    def run(reading=READING):
        return import_objects(
            find_objects(root / "gs", reading), reading, out, source=root, seed=0, progress=lambda *_: None
        )

    made = run()
    assert made.counts == {"train": 3, "test": 1} and made.problems == ()
    train, test = (load_clips(out / split, frames=3) for split in ("train", "test"))
    assert train.classes == test.classes == MODELNET_10 != CLASSES
    assert [MODELNET_10[label] for label in train.label] == ["chair", "night_stand", "night_stand"]
    assert train.columns.shape == (3, 3, 32, 14) and train.present.all()
    assert test.present.tolist() == [[True, False, False]]
    assert train.take(np.array([1])).classes == MODELNET_10
    before = load_clip(out / "train/chair_0001.npz").columns
    (out / "train/chair_0001.npz").unlink()
    run()
    np.testing.assert_array_equal(load_clip(out / "train/chair_0001.npz").columns, before)
    with pytest.raises(UserError, match="another imported"):
        run(ObjectReading(versions=2, validation=0.0))


def test_clips_of_two_data_sets_do_not_mix(root, tmp_path):
    for subset in ("modelnet10", "modelnet40"):
        reading = ObjectReading(subset=subset, versions=1, validation=0.0, decimation=READING.decimation)
        objects = find_objects(root / "gs", reading)[:1]
        import_objects(objects, reading, tmp_path / subset, source=root, seed=0, progress=lambda *_: None)
    with pytest.raises(UserError, match="is of the classes airplane, bathtub"):
        load_clips(tmp_path / "modelnet10/train", tmp_path / "modelnet40/train", frames=1)


def test_what_is_wrong_is_named(root):
    with pytest.raises(UserError, match=r"modelnet40_train\.txt is missing"):
        find_objects(root / "gs", ObjectReading(subset="modelnet40"), lists=root)
    with pytest.raises(UserError, match="all objects of modelnet10 are missing"):
        find_objects(root / "elsewhere", READING)
    (root / "modelnet10_train.txt").write_text("chair_0777\n")
    with pytest.raises(UserError, match=r"1 objects of modelnet10 are missing: .*chair_0777"):
        find_objects(root / "gs", READING, lists=root)
    (root / "modelnet10_train.txt").write_text("airplane_0001\n")
    with pytest.raises(UserError, match="'airplane_0001' is of no class of modelnet10"):
        find_objects(root / "gs", READING, lists=root)
    with pytest.raises(UserError, match=r"validation is 1\.0"):
        ObjectReading(validation=1.0)
