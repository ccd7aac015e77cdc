"""Scenes on disk: what is read is what was written, and damage is named."""

from __future__ import annotations

import numpy as np
import pytest
from support.view_sets import ball_scenes

from aerojax.core.errors import UserError
from aerojax.data.views import ARRAYS, TEXTS, load_views, save_views


@pytest.mark.long
def test_shards_are_joined_in_order_and_cut(tmp_path):
    scenes = ball_scenes(2, size=16)
    for number in (1, 0):
        save_views(tmp_path / f"views_{number:05d}.npz", scenes)
    whole = load_views([tmp_path])
    assert len(whole) == 4 and whole.size == 16 and whole.name == (*scenes.name, *scenes.name)
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(whole, name)[2:], getattr(scenes, name))
    cut = load_views([tmp_path], most=3)
    assert len(cut) == 3 and all(len(getattr(cut, name)) == 3 for name in TEXTS)


def test_folders_that_cannot_be_used_are_named(tmp_path):
    with pytest.raises(UserError, match="holds no views"):
        load_views([tmp_path])
    save_views(tmp_path / "a" / "views_00000.npz", ball_scenes(1, size=16))
    save_views(tmp_path / "b" / "views_00000.npz", ball_scenes(1, size=20))
    with pytest.raises(UserError, match="several sizes"):
        load_views([tmp_path / "a", tmp_path / "b"])
    (tmp_path / "a" / "views_00001.npz").write_bytes(b"PK\x03\x04 cut")
    with pytest.raises(UserError, match=r"views_00001\.npz is no complete shard"):
        load_views([tmp_path / "a"])
