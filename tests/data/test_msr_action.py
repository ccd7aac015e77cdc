"""MSR-Action3D's files, written here in the published formats: depth maps, skeletons, names, subjects."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from aerojax.core.errors import UserError
from aerojax.data.clips import load_clips
from aerojax.data.imports.msr_action import (
    ACTIONS,
    ActionReading,
    depth_points,
    drawn_points,
    find_recordings,
    import_recordings,
    read_depth_file,
    read_skeleton_file,
    recording_columns,
)

WIDTH, HEIGHT = 8, 6


def write_depth(path, depth) -> None:
    """Frames, columns, rows, then the depths, all little-endian 32-bit integers."""
    path.parent.mkdir(parents=True, exist_ok=True)
    numbers = np.asarray(depth).ravel().tolist()
    path.write_bytes(struct.pack(f"<3I{len(numbers)}I", len(depth), WIDTH, HEIGHT, *numbers))


def depth_of(frames: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    depth = rng.integers(800, 3000, (frames, HEIGHT, WIDTH))
    depth[:, :2] = 0
    return depth


@pytest.fixture
def root(tmp_path):
    names = ("a01_s01_e01", "a01_s05_e02", "a20_s06_e01", "a13_s10_e03")
    for number, name in enumerate(names):
        write_depth(tmp_path / "Depth" / f"{name}_sdepth.bin", depth_of(3 + number, number))
    return tmp_path


def test_subjects_decide_the_split(root):
    found = find_recordings(root, ActionReading())
    assert [(one.name, one.label, one.identity, one.split) for one in found] == [
        ("a01_s01_e01", "high_arm_wave", "subject_01", "train"),
        ("a01_s05_e02", "high_arm_wave", "subject_05", "val"),
        ("a13_s10_e03", "bend", "subject_10", "test"),
        ("a20_s06_e01", "pickup_and_throw", "subject_06", "test"),
    ]
    assert len(ACTIONS) == len(set(ACTIONS)) == 20
    assert find_recordings(root, ActionReading(validation=()))[1].split == "train"


def test_depths_come_back_row_by_row(root):
    file = root / "Depth/a01_s01_e01_sdepth.bin"
    np.testing.assert_array_equal(read_depth_file(file), depth_of(3))


def test_points_by_hand():
    depth = np.zeros((HEIGHT, WIDTH), np.uint32)
    depth[1, 7] = 1400
    # (7 - 4) / 280 · 1400 = 15 to the right, (1 - 3) / 280 · 1400 = 10 upwards, 1400 away.
    np.testing.assert_allclose(depth_points(depth), [[15.0, 1400.0, 10.0]])


def test_points_are_drawn_once_each_or_equally_often():
    points, rng = np.arange(30.0).reshape(10, 3), np.random.default_rng(0)
    few = drawn_points(points, 6, rng)
    assert len(np.unique(few, axis=0)) == 6
    counts = np.unique(drawn_points(points, 24, rng), axis=0, return_counts=True)[1]
    assert sorted(counts) == [2] * 6 + [3] * 4


def test_a_clip_is_centred_once_and_keeps_its_motion(root):
    depth = np.zeros((3, HEIGHT, WIDTH), np.uint32)
    depth[0, 3, 4], depth[2, 3, 4] = 600, 1200  # on the axis; the middle frame shows nothing
    write_depth(root / "Depth/a02_s02_e01_sdepth.bin", depth)
    recording = find_recordings(root, ActionReading())[2]
    assert recording.name == "a02_s02_e01"
    columns = recording_columns(recording, ActionReading(points=2), seed=0)
    assert columns.shape == (2, 2, 14)
    np.testing.assert_allclose(columns[:, 0, :3], [[0, -1, 0], [0, 1, 0]], atol=1e-6)  # (900 ± 300) / 300
    assert np.all(columns[..., 3] == 1) and np.all(columns[..., 10] == 1) and not columns[..., 11:].any()


def test_clips_of_20_classes(root, tmp_path):
    reading, out = ActionReading(points=16), tmp_path / "clips"
    made = import_recordings(
        find_recordings(root, reading), reading, out, source=root, seed=0, progress=lambda *_: None
    )
    assert made.counts == {"train": 1, "val": 1, "test": 2} and made.problems == ()
    test = load_clips(out / "test", frames=8)
    assert test.classes == ACTIONS and [ACTIONS[label] for label in test.label] == ["bend", "pickup_and_throw"]
    assert test.present.sum(axis=1).tolist() == [6, 5] and test.identity == ("subject_10", "subject_06")


def test_skeletons(tmp_path):
    rng = np.random.default_rng(1)
    joints = rng.normal(size=(4, 20, 3)).round(4)
    rows = ["  ".join(f"{v:.4f}" for v in (*joint, 1.0)) for frame in joints for joint in frame]
    (tmp_path / "a03_s02_e01_skeleton3D.txt").write_text("\n".join(rows) + "\n")
    np.testing.assert_allclose(read_skeleton_file(tmp_path / "a03_s02_e01_skeleton3D.txt"), joints)
    reading = ActionReading(kind="skeleton")
    (recording,) = find_recordings(tmp_path, reading)
    columns = recording_columns(recording, reading, seed=0)
    assert (recording.label, columns.shape) == ("hammer", (4, 20, 14))
    world = joints[..., [0, 2, 1]]  # z of the camera is y of the world, y is z
    np.testing.assert_allclose(columns[..., :3], world - world.mean(axis=(0, 1)), atol=1e-5)


def test_what_is_wrong_is_named(root, tmp_path):
    with pytest.raises(UserError, match=r"holds no file \*_skeleton3D\.txt"):
        find_recordings(root, ActionReading(kind="skeleton"))
    short = root / "Depth/a01_s01_e01_sdepth.bin"
    short.write_bytes(short.read_bytes()[:-4])
    with pytest.raises(UserError, match="3 frames of 8×6 are announced and 143 numbers follow"):
        read_depth_file(short)
    empty = tmp_path / "a01_s01_e09_sdepth.bin"
    write_depth(empty, np.zeros((2, HEIGHT, WIDTH), int))
    reading = ActionReading(points=4)
    made = import_recordings(
        find_recordings(root, reading), reading, tmp_path / "out", source=root, seed=0, progress=lambda *_: None
    )
    assert len(made.problems) == 2 and "no frame shows anything" in made.problems[1]
    (root / "Depth/a21_s01_e01_sdepth.bin").touch()
    with pytest.raises(UserError, match=r"a21_s01_e01_sdepth\.bin: the name says no action of 1 to 20"):
        find_recordings(root, ActionReading())
    wrong = tmp_path / "a01_s01_e01_skeleton3D.txt"
    wrong.write_text("1 2 3 x")
    with pytest.raises(UserError, match="cannot be read as numbers"):
        read_skeleton_file(wrong)
    wrong.write_text("1 2 3 4\n" * 19)
    with pytest.raises(UserError, match="whole frames of 20 lines"):
        read_skeleton_file(wrong)
