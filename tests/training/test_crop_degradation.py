"""Hidden parts and large pixels: what they leave, where the next window is cut, and that pixels are means."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from support.crop_examples import crops_of, random_crops

from aerojax.training.crop_degradation import coarsen, hide, seen_window
from aerojax.training.crop_variation import CropVariationConfig, vary_images

KEYS = jax.random.split(jax.random.key(3), 48)
DISC = (np.hypot(*np.mgrid[-15.5:16, -15.5:16]) < 13).astype(np.float32)


def test_things_in_the_way_are_of_some_clips_and_about_half_of_their_cameras():
    coverage = jnp.ones((3, 6, 32, 32))
    draw = jax.jit(lambda key: hide(coverage, 0.5, key=key))
    hidden = np.stack([~np.asarray(draw(key)).all(axis=(-2, -1)) for key in KEYS]).any(axis=1)
    clips = hidden.any(axis=1)
    assert 0.3 < clips.mean() < 0.65
    assert 0.3 < hidden[clips].mean() < 0.65
    assert np.asarray(hide(coverage, 0.0, key=KEYS[0])).all()


def test_what_is_in_the_way_is_straight_and_drifts():
    shown = np.asarray(jax.jit(lambda key: hide(jnp.ones((8, 6, 32, 32)), 1.0, key=key))(KEYS[1]))
    share = shown.mean(axis=(-2, -1))
    moving = (share.min(axis=0) < 1) & (share.max(axis=0) > 0)
    assert (np.ptp(share, axis=0)[moving] > 0).any()
    # A strip's two edges are lines: no row changes more often than two strips can.
    assert np.abs(np.diff(shown.astype(int), axis=-1)).sum(axis=-1).max() <= 4


def test_the_next_window_is_cut_about_what_is_left():
    whole = jnp.asarray(DISC)[None, None]
    rest = whole.at[..., 16:].set(0.0)
    side, middle, left = seen_window(whole, rest)
    # Of a disc of 26 pixels its left half: 13 wide and 26 high, around 9.5 from the crop's left.
    np.testing.assert_allclose(side, 1.0)
    np.testing.assert_allclose(middle[0, 0], [-6.5, 0.0], atol=1e-6)
    side, middle, left = seen_window(whole, rest.at[..., :16, :].set(0.0))
    np.testing.assert_allclose(side, 0.5, atol=1e-6)
    np.testing.assert_allclose(middle[0, 0], [-6.5, 6.5], atol=1e-6)
    assert bool(left.all())
    side, middle, left = seen_window(whole, whole)
    assert float(side[0, 0]) == 1.0 and not np.asarray(middle).any() and bool(left.all())
    assert not bool(seen_window(whole, jnp.zeros_like(whole))[2].any())


def test_large_pixels_are_means_in_or_out_of_the_mask_and_pixels_of_a_crop_change_nothing():
    rgba = jnp.broadcast_to(jnp.asarray(DISC)[None, None, ..., None], (1, 2, 32, 32, 4))
    draw = jax.jit(lambda key: coarsen(rgba, 1.0, 6.0, key=key))
    areas, values = [], []
    for key in KEYS[:24]:
        drawn = np.asarray(draw(key))
        assert drawn.min() >= 0 and drawn.max() <= 1 + 1e-6
        assert (drawn[..., :3] <= drawn[..., 3:] + 1e-5).all()
        areas.append(drawn[0, 0, ..., 3].mean())
        values.append(len(np.unique(np.round(drawn[0, 0, ..., 3], 4))))
    # Masks of a threshold below one half are fatter, never thinner than the disc by much, and blurred when drawn.
    assert min(areas) / DISC.mean() > 0.9 and max(areas) / DISC.mean() < 2.0
    assert max(values) > 10
    np.testing.assert_array_equal(coarsen(rgba, 0.0, 6.0, key=KEYS[0]), rgba)


def test_a_variation_with_everything_stays_premultiplied_and_drops_what_is_hidden():
    crops = random_crops(4)
    config = CropVariationConfig(hide=1.0, coarse=1.0)
    one = jax.jit(lambda key: vary_images(crops_of(crops.rgba, crops.valid), config, key=key))
    for key in KEYS[:4]:
        varied = one(key)
        rgba = np.asarray(varied.rgba)
        assert np.isfinite(rgba).all() and rgba.min() >= 0 and rgba.max() <= 1
        assert (rgba[..., :3] <= rgba[..., 3:] + 1e-5).all()
        assert not (np.asarray(varied.valid) & ~np.asarray(crops.valid)).any()
