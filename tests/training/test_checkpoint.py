"""Checkpoints: the newest stays, others are refused."""

from __future__ import annotations

import errno

import numpy as np
import pytest

from aerojax.core.errors import UserError
from aerojax.evaluate.kills.small_disk import small_disk
from aerojax.training.checkpoint import latest_step, restore_state, save_state


def test_checkpoints_keep_the_newest_and_refuse_another_model(tmp_path):
    assert latest_step(tmp_path / "none") is None
    for step in (1, 2, 10):
        save_state(tmp_path, step, {"a": np.arange(step, dtype=np.float32), "b": np.array(step)})
    assert [p.name for p in tmp_path.iterdir()] == ["step_00000010"]
    like = {"a": np.zeros(10, np.float32), "b": np.array(0)}
    restored = restore_state(tmp_path, 10, like)
    np.testing.assert_array_equal(restored["a"], np.arange(10))
    assert int(restored["b"]) == 10
    others = (
        like | {"a": np.zeros(9, np.float32)},
        like | {"a": np.zeros(10, np.float64)},
        like | {"c": np.zeros(1)},
        {"a": like["a"]},
        {"a": like["a"], "d": like["b"]},
    )
    for other in others:
        with pytest.raises(UserError, match="belongs to another model, optimiser or training set") as caught:
            restore_state(tmp_path, 10, other)
        assert caught.value.code == "mismatch"
    (tmp_path / "step_00000011.orbax-checkpoint-tmp").mkdir()  # what a kill while writing leaves
    assert latest_step(tmp_path) == 10


def test_a_full_disk_is_told_and_the_older_checkpoint_stays(tmp_path, monkeypatch):
    generator = np.random.default_rng(0)
    state = {name: generator.random((160, 160), np.float32) for name in "abcdefgh"}  # 820 kB that do not compress
    with small_disk(tmp_path / "disk", 1_400_000) as disk:
        if disk is None:
            pytest.skip("this process may not mount")
        folder = tmp_path / "disk/checkpoints"
        save_state(folder, 1, state)
        with pytest.raises(OSError) as told, monkeypatch.context() as patch:
            patch.delattr("aerojax.training.checkpoint._manager")  # whose threads would complain one by one
            save_state(folder, 2, state)
        assert told.value.errno == errno.ENOSPC and told.value.filename == str(folder)
        np.testing.assert_array_equal(restore_state(folder, 1, state)["a"], state["a"])
        disk.grow(4_000_000)
        save_state(folder, 2, state)
        assert [p.name for p in folder.iterdir()] == ["step_00000002"]
