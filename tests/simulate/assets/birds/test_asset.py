"""Every family of birds: closed, small, one metre wide, in one piece, with wings that beat on their own side."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from support.skinned_poses import posed

from aerojax.simulate.assets.birds.asset import build_bird
from aerojax.simulate.assets.birds.families import BirdParameters, bird_families, draw_bird

each = pytest.mark.parametrize("family", bird_families())


def _drawn(family: str, seed: int) -> BirdParameters:
    return draw_bird(family, np.random.default_rng(seed))


@each
def test_shapes_are_closed_small_and_one_metre_wide(family):
    for seed in (0, 1):
        asset = build_bird(_drawn(family, seed))
        assert 500 <= sum(len(p.part.mesh.faces) for p in asset.parts) <= 6000
        wing = next(p for p in asset.parts if p.part.name == "wing_left").part.mesh.points
        assert wing[:, 1].max() == pytest.approx(0.5)
        for skinned in asset.parts:
            solid = trimesh.Trimesh(skinned.part.mesh.points, skinned.part.mesh.faces, process=False)
            assert np.isfinite(solid.vertices).all()
            assert solid.is_watertight and solid.volume > 0, skinned.part.name
            assert skinned.weights.sum(1) == pytest.approx(1.0) and skinned.weights.min() >= 0


@each
def test_parts_hang_together(family):
    """Bill, tail and both wings start inside the trunk: their nearest ends lie within its bounds."""
    asset = build_bird(_drawn(family, 0))
    points = {p.part.name: p.part.mesh.points for p in asset.parts}
    low, high = points["trunk"].min(0), points["trunk"].max(0)
    for name in ("bill", "tail", "wing_left", "wing_right"):
        inside = ((points[name] > low) & (points[name] < high)).all(1)
        assert inside.sum() >= 3, name


@each
def test_cycle_closes_and_turns_are_unit(family):
    motion = build_bird(_drawn(family, 0)).motion
    assert np.linalg.norm(motion.quaternion, axis=-1) == pytest.approx(1.0)
    assert motion.quaternion[-1] == pytest.approx(motion.quaternion[0], abs=1e-9)
    assert motion.shift[-1] == pytest.approx(motion.shift[0], abs=1e-9)
    assert (np.diff(motion.seconds) > 0).all() and motion.seconds[0] == 0


@each
def test_wings_beat_on_their_own_side_and_far(family):
    """While it flaps, no bird puts the outer half of a wing through the other one; the tip covers its stroke."""
    drawn = _drawn(family, 2)
    asset = build_bird(replace(drawn, beat=replace(drawn.beat, glide_seconds=0.0, beats=1)))
    tip = next(p for p in asset.parts if p.part.name == "wing_left").part.mesh.points[:, 1].argmax()
    frames = np.stack([posed(asset, i, "wing_left") for i in range(0, 24, 2)])
    rest = next(p for p in asset.parts if p.part.name == "wing_left").part.mesh.points
    assert frames[:, rest[:, 1] > 0.2, 1].min() > 0.0
    swing = np.linalg.norm(frames[:, tip] - frames[0, tip], axis=1).max()
    assert swing > 0.7 * np.sin(np.deg2rad(drawn.beat.rise + drawn.beat.fall) / 2)
    mirrored = np.array([1.0, -1.0, 1.0])
    assert posed(asset, 5, "wing_right") * mirrored == pytest.approx(posed(asset, 5, "wing_left"), abs=1e-9)
