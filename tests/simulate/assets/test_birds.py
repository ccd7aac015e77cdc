"""Birds: wing-beat frequencies against Pennycuick's formula by hand, shapes of every family, laws of the wing beat."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from aerojax.simulate.assets.birds import author as birds
from aerojax.simulate.assets.birds import bodies as bird_bodies
from aerojax.simulate.assets.birds import families as bird_families
from aerojax.simulate.assets.birds.wingbeat import WingBeat, fly, stroke, wingbeat_hertz
from aerojax.simulate.assets.mesh import lofts
from aerojax.simulate.usd.skeletons import SkinnedAsset

each = pytest.mark.parametrize("family", bird_families.FAMILIES)
STEADY = WingBeat(4.0, 40.0, 30.0, 0.5, 30.0, 0.05, 0.02, 3, 0.0, 8.0, False, 0.0, 0.0, 0.0)


def _drawn(family: str, seed: int) -> birds.BirdParameters:
    return birds.draw_parameters(family, np.random.default_rng(seed))


def _matrix(quaternion: np.ndarray) -> np.ndarray:
    w, x, y, z = quaternion
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + 2 * w * cross + 2 * cross @ cross


def _posed(asset: SkinnedAsset, sample: int, name: str) -> np.ndarray:
    """Linear-blend skinning of one part at one sample of the motion."""
    bones, motion = asset.skeleton, asset.motion
    turn, place = [], []
    for joint, pivot in enumerate(bones.pivots):
        own, parent = _matrix(motion.quaternion[sample, joint]), bones.parent(joint)
        offset = pivot + motion.shift[sample, joint] - (bones.pivots[parent] if parent >= 0 else 0.0)
        turn.append(own if parent < 0 else turn[parent] @ own)
        place.append(offset if parent < 0 else place[parent] + turn[parent] @ offset)
    part = next(p for p in asset.parts if p.part.name == name)
    local = part.part.mesh.points[:, None] - bones.pivots
    return np.einsum("vj,jab,vjb->va", part.weights, np.stack(turn), local) + part.weights @ np.stack(place)


def test_pennycuick_by_hand():
    """A pigeon of 0.3 kg, span 0.63 m, wing area 0.06 m2: 0.6366 * 3.1321 * 1.5571 * 2.5543 * 0.9267."""
    assert wingbeat_hertz(0.3, 0.63, 0.63**2 / 0.06) == pytest.approx(7.350, abs=0.01)
    assert wingbeat_hertz(0.004, 0.11, 8.0) == 14.0
    assert wingbeat_hertz(20.0, 6.0, 8.0) == 2.0


def test_splits_have_the_counts_of_the_data_set_and_share_no_family():
    named = [family for families in bird_families.SPLITS.values() for family in families]
    assert {split: len(families) for split, families in bird_families.SPLITS.items()} == {
        "train": 15,
        "val": 6,
        "test": 8,
    }
    assert len(set(named)) == len(named) and set(named) == set(bird_families.FAMILIES)


@each
def test_shapes_are_closed_small_and_one_metre_wide(family):
    for seed in (0, 1):
        asset = birds.author(_drawn(family, seed))
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
    asset = birds.author(_drawn(family, 0))
    points = {p.part.name: p.part.mesh.points for p in asset.parts}
    low, high = points["trunk"].min(0), points["trunk"].max(0)
    for name in ("bill", "tail", "wing_left", "wing_right"):
        inside = ((points[name] > low) & (points[name] < high)).all(1)
        assert inside.sum() >= 3, name


@each
def test_cycle_closes_and_turns_are_unit(family):
    motion = birds.author(_drawn(family, 0)).motion
    assert np.linalg.norm(motion.quaternion, axis=-1) == pytest.approx(1.0)
    assert motion.quaternion[-1] == pytest.approx(motion.quaternion[0], abs=1e-9)
    assert motion.shift[-1] == pytest.approx(motion.shift[0], abs=1e-9)
    assert (np.diff(motion.seconds) > 0).all() and motion.seconds[0] == 0


@each
def test_wings_beat_on_their_own_side_and_far(family):
    """While it flaps, no bird puts the outer half of a wing through the other one; the tip covers its stroke."""
    drawn = _drawn(family, 2)
    asset = birds.author(replace(drawn, beat=replace(drawn.beat, glide_seconds=0.0, beats=1)))
    tip = next(p for p in asset.parts if p.part.name == "wing_left").part.mesh.points[:, 1].argmax()
    frames = np.stack([_posed(asset, i, "wing_left") for i in range(0, 24, 2)])
    rest = next(p for p in asset.parts if p.part.name == "wing_left").part.mesh.points
    assert frames[:, rest[:, 1] > 0.2, 1].min() > 0.0
    swing = np.linalg.norm(frames[:, tip] - frames[0, tip], axis=1).max()
    assert swing > 0.7 * np.sin(np.deg2rad(drawn.beat.rise + drawn.beat.fall) / 2)
    mirrored = np.array([1.0, -1.0, 1.0])
    assert _posed(asset, 5, "wing_right") * mirrored == pytest.approx(_posed(asset, 5, "wing_left"), abs=1e-9)


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
        assert _matrix(top) @ along == pytest.approx(np.array(expected), abs=1e-9)


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
    backward = _matrix(motion.quaternion[middle, 3]) @ np.array([0.0, 1.0, 0.0])
    assert backward[0] < -0.95


@pytest.mark.parametrize("tail", bird_bodies.TAILS)
def test_tails_keep_their_width_and_length(tail):
    shape = replace(_drawn("gull", 0).shape, tail=tail, tail_length=0.3, tail_width=0.2, body_width=0.1)
    points = bird_bodies.tail(shape).points
    longest = float(np.max(bird_bodies.TAILS[tail](np.linspace(0, 1, 50))))
    assert shape.rump - points[:, 0].min() == pytest.approx(0.3 * longest, rel=0.12)
    edge = float(bird_bodies.TAILS[tail](np.ones(1))[0])
    if edge > 0.9:
        assert np.ptp(points[:, 1]) == pytest.approx(0.2, rel=0.1)


def test_fan_is_closed_and_notched_where_it_ends_early():
    angle = np.linspace(-30.0, 30.0, 7)
    outer = np.where(angle == 0, 0.5, 1.0)
    sheet = lofts.fan(angle, 0.1, outer, (0.02, 0.01))
    solid = trimesh.Trimesh(sheet.points, sheet.faces, process=False)
    assert solid.is_watertight and solid.volume > 0
    assert sheet.points[np.abs(sheet.points[:, 1]) < 1e-9, 0].min() == pytest.approx(-0.5)
    assert np.linalg.norm(sheet.points[:, :2], axis=1).max() == pytest.approx(1.0)


def test_every_bill_and_tail_belongs_to_a_bird():
    for field, known in (("bill", bird_bodies.BILLS), ("tail", bird_bodies.TAILS)):
        used = [ranges[field] for ranges in bird_families.FAMILIES.values()]
        assert {v for one in used for v in (one if isinstance(one, list) else [one])} == set(known)
