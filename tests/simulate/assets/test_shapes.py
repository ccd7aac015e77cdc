"""shapes-10: closed solids of ten kinds, Gaussians in the unit ball, clips that are made once."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from aerojax.core.errors import UserError
from aerojax.data.clips import load_clip, load_clips
from aerojax.simulate.assets.shapes.clips import ShapesConfig, build_shape, make_shapes, shape_columns
from aerojax.simulate.assets.shapes.kinds import KINDS, SHAPES_10

TINY = ShapesConfig(per_class={"train": 1, "test": 1}, tokens=32, versions=2)


@pytest.mark.parametrize("kind", SHAPES_10)
def test_kinds_are_closed_and_vary(kind):
    one, again, other = (KINDS[kind](np.random.default_rng(seed)) for seed in (1, 1, 2))
    solid = trimesh.Trimesh(one.points, one.faces, process=False)  # parts may touch
    assert solid.is_watertight and solid.is_winding_consistent and solid.volume > 0
    assert 0.5 < np.ptp(one.points, axis=0).max() < 1.5
    np.testing.assert_array_equal(one.points, again.points)
    assert one.points.shape != other.points.shape or not np.allclose(one.points, other.points)


def test_there_are_ten_kinds_with_a_colour_a_thing():
    assert len(SHAPES_10) == 10 and tuple(sorted(SHAPES_10)) == SHAPES_10
    first, second = (build_shape(f"ring_{number}").albedo.mean(axis=0) for number in range(2))
    assert np.abs(first - second).max() > 0.01


def test_columns_lie_in_the_unit_ball_and_in_random_order():
    columns = shape_columns("table_x", 2, ShapesConfig(tokens=500))
    assert columns.shape == (2, 500, 14)
    assert np.linalg.norm(columns[..., :3], axis=-1).max() == pytest.approx(1.0, abs=1e-5)
    assert not np.array_equal(columns[0], columns[1])
    halves = columns[0, :250, :3].mean(axis=0) - columns[0, 250:, :3].mean(axis=0)
    assert np.abs(halves).max() < 0.15
    np.testing.assert_array_equal(columns, shape_columns("table_x", 2, ShapesConfig(tokens=500)))


def test_clips_are_made_once_and_carry_their_classes(tmp_path):
    assert make_shapes(TINY, tmp_path, progress=lambda *_: None) == {"train": 10, "test": 10}
    train = load_clips(tmp_path / "train", frames=2)
    assert train.classes == SHAPES_10 and sorted(train.label.tolist()) == list(range(10)) and train.present.all()
    path = tmp_path / "test/arch_test_0_0000.npz"
    before, moment = load_clip(path), path.stat().st_mtime_ns
    assert before.columns.shape == (1, 32, 14) and before.label == "arch"
    more = ShapesConfig(per_class={"test": 2}, tokens=32, versions=2)
    make_shapes(more, tmp_path, progress=lambda *_: None)
    assert path.stat().st_mtime_ns == moment and len(list((tmp_path / "test").glob("*.npz"))) == 20
    with pytest.raises(UserError, match="another tokens"):
        make_shapes(ShapesConfig(tokens=16), tmp_path, progress=lambda *_: None)


def test_numbers_that_make_no_sense_are_refused():
    with pytest.raises(UserError, match="per_class is"):
        ShapesConfig(per_class={"train": -1})
    with pytest.raises(UserError, match="tokens is 0"):
        ShapesConfig(tokens=0)
