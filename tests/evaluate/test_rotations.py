"""Rotation protocols: stored conversions, the Haar measure, a cache that no order changes, and what a turn acts on."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.clip_examples import random_clip, rotate_columns

from aerojax.core.errors import UserError
from aerojax.core.types import SH_C0
from aerojax.evaluate.rotations import (
    PROTOCOLS,
    cached_rotations,
    draw_rotations,
    protocols_of,
    quaternions_about_z,
    quaternions_from_normals,
    rotate_clip,
)
from aerojax.geometry.rotations import rotation_from_quaternion

CLIPS = ["sim1/test/bird_0@0", "sim1/test/bird_0@3", "sim2/test/bird_0@0"]


@pytest.mark.parametrize("trial", [0, 1, 2])
def test_conversions_are_the_stored_ones(shared, trial):
    golden = np.load(shared / "golden/classifier/rotation_cache.npz")
    for name in ("so3", "so3_per_frame"):
        turns = quaternions_from_normals(golden[f"normal4/{name}_{trial}"])
        np.testing.assert_allclose(turns, golden[f"quat/{name}_{trial}"], atol=1e-6)
        matrices = np.asarray(rotation_from_quaternion(jnp.asarray(turns)))
        np.testing.assert_allclose(matrices, golden[f"{name}_{trial}"].reshape(-1, 3, 3), atol=1e-6)
    about = quaternions_about_z(golden[f"angle/z_{trial}"])
    np.testing.assert_allclose(rotation_from_quaternion(jnp.asarray(about)), golden[f"z_{trial}"], atol=1e-6)


def test_no_two_draws_share_a_rotation():
    draws = [
        draw_rotations(clip, "so3", frames=1, seed=seed, trial=trial)[0]
        for clip in CLIPS
        for seed in (1, 2, 3, 4, 5)
        for trial in (0, 1, 2)
    ]
    assert len(np.unique(np.round(draws, 6), axis=0)) == len(draws)


def test_clip_rotations_are_one_and_frame_rotations_many():
    for kind in ("none", "z", "so3"):
        turns = draw_rotations("a", kind, frames=4, seed=0, trial=0)
        np.testing.assert_array_equal(turns, np.tile(turns[0], (4, 1)))
    np.testing.assert_array_equal(draw_rotations("a", "none", frames=1, seed=0, trial=0), [[1, 0, 0, 0]])
    turns = draw_rotations("a", "so3_per_frame", frames=4, seed=0, trial=0)
    assert len(np.unique(np.round(turns, 6), axis=0)) == 4
    longer = draw_rotations("a", "so3_per_frame", frames=9, seed=0, trial=0)
    np.testing.assert_array_equal(longer[:4], turns)


def test_rotations_are_uniform():
    turns = draw_rotations("a", "so3_per_frame", frames=20000, seed=0, trial=0)
    np.testing.assert_allclose(np.linalg.norm(turns, axis=1), 1.0)
    # Of the Haar measure: mean matrix zero, and angle θ with density (1-cos θ)/π, mean π/2 + 2/π.
    matrices = np.asarray(rotation_from_quaternion(jnp.asarray(turns, jnp.float32)))
    np.testing.assert_allclose(matrices.mean(axis=0), np.zeros((3, 3)), atol=0.02)
    angle = 2 * np.arccos(np.clip(turns[:, 0], -1, 1))
    assert angle.mean() == pytest.approx(np.pi / 2 + 2 / np.pi, abs=0.02)
    # About z all angles are alike, so the mean turn vanishes there too.
    about = [draw_rotations(str(i), "z", frames=1, seed=0, trial=0)[0] for i in range(4000)]
    assert np.abs(np.asarray(about)[:, 1:3]).max() == 0
    azimuth = 2 * np.arctan2(np.asarray(about)[:, 3], np.asarray(about)[:, 0])
    assert abs(np.exp(1j * azimuth).mean()) < 0.05


def test_the_cache_does_not_know_the_order_of_clips(tmp_path):
    draw = {"kind": "so3", "frames": 2, "seed": 3, "trial": 1}
    forward = cached_rotations(tmp_path / "a", CLIPS, **draw)
    backward = cached_rotations(tmp_path / "b", CLIPS[::-1], **draw)
    np.testing.assert_array_equal(forward, backward[::-1])
    (file,), (other,) = (sorted((tmp_path / name).iterdir()) for name in "ab")
    assert file.read_bytes() == other.read_bytes()
    # Clips that come later join those that are there, which stay as they are.
    more = cached_rotations(tmp_path / "a", ["new", CLIPS[1]], **draw)
    np.testing.assert_array_equal(more[1], forward[1])
    np.testing.assert_array_equal(cached_rotations(tmp_path / "a", CLIPS, **draw), forward)


def test_the_cache_is_what_counts(tmp_path):
    draw = {"kind": "z", "frames": 1, "seed": 0, "trial": 0}
    cached_rotations(tmp_path, ["a"], **draw)
    (file,) = tmp_path.iterdir()
    np.savez(file, clip=np.array(["a"]), quaternion=np.array([[[0.0, 1.0, 0.0, 0.0]]]))
    np.testing.assert_array_equal(cached_rotations(tmp_path, ["a"], **draw), [[[0, 1, 0, 0]]])
    file.write_bytes(b"no numbers")
    with pytest.raises(UserError, match=r"z_seed0_trial0_frames1\.npz cannot be read"):
        cached_rotations(tmp_path, ["a"], **draw)


turn = jax.jit(rotate_clip)


def test_a_turn_acts_on_centres_and_axes_alone():
    clip = random_clip(0, time=2, tokens=8)
    turns = draw_rotations("a", "so3_per_frame", frames=2, seed=0, trial=0)
    turned = turn(clip, jnp.asarray(turns, jnp.float32))
    matrices = rotation_from_quaternion(jnp.asarray(turns, jnp.float32))
    for frame in range(2):
        expected = rotate_columns(clip[frame], matrices[frame])
        np.testing.assert_allclose(turned[frame], expected, atol=2e-6)
    np.testing.assert_array_equal(turned[..., 7:], clip[..., 7:])
    # Seen from outside: colour 0.5 + C0·f is the same from everywhere, so it has nothing to turn.
    colour = 0.5 + SH_C0 * np.asarray(turned[..., 11:])
    np.testing.assert_array_equal(colour, 0.5 + SH_C0 * np.asarray(clip[..., 11:]))
    still = turn(clip, jnp.tile(jnp.array([1.0, 0, 0, 0]), (2, 1)))
    np.testing.assert_allclose(jnp.abs(still[..., 3:7]), jnp.abs(clip[..., 3:7]), atol=1e-6)
    np.testing.assert_array_equal(still[..., :3], clip[..., :3])


def test_each_training_answers_for_its_protocols():
    names = [p.name for p in PROTOCOLS]
    assert names == ["none/none", "z/z", "z/SO3", "SO3/SO3", "z/SO3_pf"]
    assert [p.test for p in PROTOCOLS] == ["none", "z", "so3", "so3", "so3_per_frame"]
    assert [p.name for p in protocols_of("z", exactly_invariant=False)] == ["z/z", "z/SO3", "z/SO3_pf"]
    assert [p.name for p in protocols_of("so3", exactly_invariant=False)] == ["SO3/SO3"]
    assert protocols_of("none", exactly_invariant=True) == PROTOCOLS
