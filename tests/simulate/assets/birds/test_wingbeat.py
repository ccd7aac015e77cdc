"""Wing beats: frequencies against Pennycuick's formula by hand, strokes, glides and bounds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.skinned_poses import matrix_of

from aerojax.simulate.assets.birds.wingbeat import WingBeat, fly, stroke, wingbeat_hertz

STEADY = WingBeat(4.0, 40.0, 30.0, 0.5, 30.0, 0.05, 0.02, 3, 0.0, 8.0, False, 0.0, 0.0, 0.0)


def test_pennycuick_by_hand():
    """A pigeon of 0.3 kg, span 0.63 m, wing area 0.06 m2: 0.6366 * 3.1321 * 1.5571 * 2.5543 * 0.9267."""
    assert wingbeat_hertz(0.3, 0.63, 0.63**2 / 0.06) == pytest.approx(7.350, abs=0.01)
    assert wingbeat_hertz(0.004, 0.11, 8.0) == 14.0
    assert wingbeat_hertz(20.0, 6.0, 8.0) == 2.0


def test_stroke_spends_its_share_going_down():
    beat = replace(STEADY, downstroke=0.6)
    phase = np.linspace(0, 1, 1001)
    angle = stroke(beat, phase)
    assert angle[0] == pytest.approx(40.0) and angle[600] == pytest.approx(-30.0)
    assert (np.diff(angle[:601]) < 0).all() and (np.diff(angle[601:]) > 0).all()


def test_a_leaning_stroke_moves_the_wing_back_and_forth():
    """At a lean of 90 degrees the tip of the raised wing lies behind the shoulder, not above it."""
    along = np.array([0.0, 1.0, 0.0])
    for lean, expected in ((0.0, [0.0, np.cos(np.deg2rad(40)), np.sin(np.deg2rad(40))]),
                           (90.0, [-np.sin(np.deg2rad(40)), np.cos(np.deg2rad(40)), 0.0])):  # fmt: skip
        top = fly(replace(STEADY, stroke_plane=lean)).quaternion[0, 3]
        assert matrix_of(top) @ along == pytest.approx(np.array(expected), abs=1e-9)


def test_glides_hold_the_wings_rock_the_body_and_end_level():
    beat = replace(STEADY, glide_seconds=2.0, rock=6.0, glide_flex=15.0)
    motion = fly(beat)
    gliding = motion.seconds > beat.beats / beat.hertz
    arm = np.degrees(2 * np.arcsin(motion.quaternion[gliding, 3, 1]))
    assert np.abs(motion.quaternion[gliding, 3] - motion.quaternion[gliding, 3][0]).max() < 1e-9
    assert arm[0] == pytest.approx(8.0, abs=0.1)
    roll = np.degrees(2 * np.arcsin(motion.quaternion[:, 0, 1]))
    assert roll[gliding].max() == pytest.approx(6.0) and roll[gliding].min() == pytest.approx(-6.0)
    assert roll[-1] == pytest.approx(0.0, abs=1e-9) and np.abs(roll[~gliding]).max() == 0.0


def test_bounding_birds_fold_their_wings():
    motion = fly(replace(STEADY, glide_seconds=0.3, bounding=True))
    middle = np.searchsorted(motion.seconds, STEADY.beats / STEADY.hertz + 0.15)
    backward = matrix_of(motion.quaternion[middle, 3]) @ np.array([0.0, 1.0, 0.0])
    assert backward[0] < -0.95
