"""Variation of crops: what stays the same over a clip, what the strengths do, how many cameras stay."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.crop_examples import crops_of, random_crops

from aerojax.core.errors import UserError
from aerojax.training.crop_variation import CropVariationConfig, leave_out, move_edges, resample, roll_maps, vary_images

NOTHING = CropVariationConfig(
    roll=False,
    mirror=False,
    shrink=0.0,
    edge=0.0,
    blur=0.0,
    steepness=0.0,
    colour=0.0,
    drop=0.0,
    lose=0.0,
    hide=0.0,
    coarse=0.0,
)
KEYS = jax.random.split(jax.random.key(0), 64)


def test_without_strength_a_clip_stays_as_it_is_and_what_does_not_count_is_zero():
    crops = random_crops(0)
    valid = crops.valid.at[1:3, 2].set(False)
    varied = vary_images(crops_of(crops.rgba, valid), NOTHING, key=KEYS[0])
    np.testing.assert_array_equal(varied.valid, valid)
    expected = np.where(valid[..., None, None, None], crops.rgba, 0.0)
    np.testing.assert_allclose(varied.rgba, expected, atol=1e-5)


def test_a_varied_clip_is_still_premultiplied_colour_and_coverage():
    crops, config = random_crops(1), CropVariationConfig()
    one = jax.jit(lambda key: vary_images(crops, config, key=key))
    varied, other = one(KEYS[0]), one(KEYS[1])
    rgba = np.asarray(varied.rgba)
    assert rgba.min() >= 0 and rgba.max() <= 1
    assert (rgba[..., :3] <= rgba[..., 3:] + 1e-6).all()
    assert np.abs(rgba - np.asarray(other.rgba)).max() > 0.1


def test_a_clip_that_stands_still_does_so_when_it_is_varied():
    crops = random_crops(2, time=1)
    still = crops_of(jnp.repeat(crops.rgba, 4, axis=0), jnp.repeat(crops.valid, 4, axis=0))
    rgba = vary_images(still, CropVariationConfig(), key=KEYS[0]).rgba
    np.testing.assert_allclose(rgba, jnp.broadcast_to(rgba[:1], rgba.shape), atol=1e-6)


def test_rolls_are_of_each_camera_and_mirroring_of_all_together():
    config = dataclasses.replace(NOTHING, roll=True, mirror=True, shrink=0.4)
    maps = np.stack([roll_maps(5, config, key=key) for key in KEYS])
    determinant = np.linalg.det(maps)
    assert (np.sign(determinant) == np.sign(determinant[:, :1])).all()
    assert 16 < (determinant[:, 0] < 0).sum() < 48
    zoom = np.sqrt(np.abs(determinant))
    assert zoom.min() >= 1 and zoom.max() <= np.exp(0.4) and zoom.max() > np.exp(0.3)
    square = np.swapaxes(maps, -1, -2) @ maps
    np.testing.assert_allclose(square, zoom[..., None, None] ** 2 * np.eye(2), atol=1e-5)
    assert np.std(np.arctan2(maps[..., 1, 0], maps[..., 1, 1])[0]) > 0.1


def test_a_quarter_turn_is_exact():
    crop = jnp.asarray(np.random.default_rng(0).random((8, 8, 4)).astype(np.float32))
    turned = resample(crop, jnp.array([[0.0, -1.0], [1.0, 0.0]]), jnp.zeros(2))
    np.testing.assert_allclose(turned, np.rot90(crop, k=1), atol=1e-5)
    mirrored = resample(crop, jnp.array([[-1.0, 0.0], [0.0, 1.0]]), jnp.zeros(2))
    np.testing.assert_allclose(mirrored, crop[:, ::-1], atol=1e-5)
    moved = resample(crop, jnp.eye(2), jnp.array([2.0, -1.0]))
    np.testing.assert_allclose(moved[1:, :-2], crop[:-1, 2:], atol=1e-6)


@pytest.mark.parametrize("name", ["edge", "steepness", "blur"])
def test_each_strength_of_the_edges_moves_them_and_leaves_empty_and_full_alone(name):
    config = dataclasses.replace(NOTHING, **{name: 0.4})
    ramp = jnp.broadcast_to(jnp.clip((jnp.arange(32.0) - 8) / 16, 0, 1)[:, None], (32, 32))
    rgba = jnp.broadcast_to(ramp[None, None, ..., None], (1, 1, 32, 32, 4))
    areas, moves = [], []
    for key in KEYS[:12]:
        varied = np.asarray(move_edges(rgba, config, key=key))[0, 0, :, 4:-4]
        np.testing.assert_allclose(varied[:6], 0.0, atol=1e-6)
        np.testing.assert_allclose(varied[26:30], 1.0, atol=1e-6)
        areas.append(varied[..., 3].mean())
        moves.append(np.abs(varied[:30, :, 3] - np.asarray(ramp[:30, 4:-4])).max())
    assert max(moves) > (1e-2 if name != "blur" else 1e-3)
    if name == "edge":
        assert min(areas) < float(ramp.mean()) < max(areas)


def test_cameras_leave_for_the_whole_clip_and_enough_of_them_stay():
    config = dataclasses.replace(NOTHING, drop=1.0, keep=2)
    valid = jnp.ones((6, 5), bool).at[:, 0].set(False).at[2].set(False)
    kept = np.stack([leave_out(valid, config, key=key) for key in KEYS])
    assert not kept[:, :, 0].any() and not kept[:, 2].any()
    seen = kept.any(axis=1)
    np.testing.assert_array_equal(kept, np.asarray(valid)[None] & seen[:, None])
    assert set(seen.sum(axis=1).tolist()) == {2, 3, 4}
    lost = np.stack([leave_out(valid, dataclasses.replace(NOTHING, lose=0.5), key=key) for key in KEYS[:8]])
    assert 0.3 < lost.sum() / (8 * np.asarray(valid).sum()) < 0.7


@pytest.mark.parametrize(
    "field",
    [{"edge": 0.5}, {"blur": 1.1}, {"drop": -0.1}, {"lose": 2.0}, {"shrink": -1.0}, {"hide": 1.5}, {"fewest": 1.0}],
)
def test_what_cannot_be_drawn_is_refused(field):
    with pytest.raises(UserError, match=next(iter(field))):
        CropVariationConfig(**field)
