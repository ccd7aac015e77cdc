"""Birds that hold still: nothing moves, folded wings lie along the body, sitting birds stand on their legs."""

from __future__ import annotations

import numpy as np
import pytest

from aerojax.simulate.assets.birds.families import draw_bird
from aerojax.simulate.assets.hybrids.poses import POSES, HeldWings, closed, draw_pose, draw_wings, held


def test_poses_are_drawn_as_often_as_they_say():
    rng = np.random.default_rng(0)
    drawn = [draw_pose(rng) for _ in range(4000)]
    assert sum(POSES.values()) == pytest.approx(1.0)
    for pose, share in POSES.items():
        assert drawn.count(pose) / 4000 == pytest.approx(share, abs=0.03)


def test_held_wings_have_their_angles_and_stay():
    motion = held(HeldWings(raised=0.0, swept=80.0, rolled=0.0, folded=20.0, drooped=0.0), head_pitch=30.0)
    assert np.array_equal(motion.quaternion[0], motion.quaternion[1]) and not motion.shift.any()
    half = np.deg2rad(40.0)
    assert motion.quaternion[0, 3] == pytest.approx([np.cos(half), 0, 0, np.sin(half)])
    assert motion.quaternion[0, 5] == pytest.approx([np.cos(half), 0, 0, -np.sin(half)])
    assert motion.quaternion[0, 4, 3] == pytest.approx(np.sin(np.deg2rad(10.0)))
    assert motion.quaternion[0, 1] == pytest.approx([np.cos(np.deg2rad(15)), 0, np.sin(np.deg2rad(15)), 0])


def test_wings_that_close_are_narrower_and_sitting_birds_stand():
    shape = draw_bird("gull", np.random.default_rng(0)).shape
    assert closed(shape, "gliding", np.random.default_rng(0)) == shape
    assert closed(shape, "folded", np.random.default_rng(0)).aspect > 1.5 * shape.aspect
    for seed in range(10):
        sitting = closed(shape, "perched", np.random.default_rng(seed))
        assert sitting.legs >= 0.08 and 20.0 <= sitting.body_pitch <= 60.0
        # Legs hang within ten degrees of the vertical: their drop adds to the trunk's pitch.
        assert 80.0 <= sitting.body_pitch + sitting.leg_drop <= 100.0


def test_angles_keep_to_their_pose():
    rng = np.random.default_rng(1)
    folded, gliding = draw_wings("folded", rng), draw_wings("gliding", rng)
    assert 74.0 <= folded.swept <= 84.0 and abs(gliding.swept) <= 14.0
