"""Motion features and the robust scale of clips: known motions, invariance, and what they are not invariant to."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.clip_examples import random_clip, rotate_columns

from aerojax.classify.mambasplat.config import MambaSplatConfig
from aerojax.classify.mambasplat.lifting import normalise_clip
from aerojax.classify.mambasplat.model import MambaSplat
from aerojax.classify.mambasplat.motion import (
    SHAPE_FEATURES,
    WINDOW,
    feature_count,
    principal_variances,
    shape_features,
    spectrum_features,
)
from aerojax.geometry.rotations import haar_rotation

MOVING = MambaSplatConfig(mode="C", motion_features=True, depth=1, mamba_layers=1, d_model=32, token_features=8)


normalised = jax.jit(normalise_clip, static_argnums=2)


def features(clip, mask=None, config=MOVING):
    mask = jnp.ones(clip.shape[:2], bool) if mask is None else mask
    return np.asarray(normalised(clip, mask, config).extra)


def flight(steps, rotations=None):
    """One cloud of points, of root mean square radius 1, that moves by `steps` and turns by `rotations`."""
    cloud = np.random.default_rng(0).normal(size=(64, 3)) * [1.0, 0.4, 0.1]
    cloud -= cloud.mean(axis=0)
    cloud /= np.sqrt((cloud**2).sum(axis=1).mean())
    place = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
    clip = np.asarray(random_clip(0, time=len(place), tokens=64, dtype=np.float64)).copy()
    for t, centre in enumerate(place):
        turned = cloud if rotations is None else cloud @ rotations[t].T
        clip[t, :, :3] = turned + centre
    return jnp.asarray(clip), cloud


def about_z(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])


def test_straight_flight_and_a_right_angle(x64):
    clip, cloud = flight(np.array([[0.5, 0, 0], [0.5, 0, 0], [0, 0.5, 0]]))
    found = features(clip)
    along = [(cloud[:, axis] ** 2).mean() for axis in (0, 0, 1)]
    np.testing.assert_allclose(found[0], 0.0)
    np.testing.assert_allclose(found[1:, 0], np.log(1.5), atol=1e-6)
    np.testing.assert_allclose(found[1:, 1], [0, 1, 0], atol=1e-3)
    np.testing.assert_allclose(found[1:, 2], along, rtol=1e-3)
    np.testing.assert_allclose(found[1:, 3:], [[1, 0, 0]] * 3, atol=1e-5)


def test_a_body_that_turns_in_place(x64):
    clip, _ = flight(np.zeros((2, 3)), [about_z(0.0), about_z(np.pi / 2), about_z(np.pi / 2)])
    found = features(clip)
    np.testing.assert_allclose(found[:, :3], 0.0, atol=1e-5)
    assert found[1, 3] < 0.7 and found[2, 3] == pytest.approx(1.0, abs=1e-6)
    slow, _ = flight(np.zeros((1, 3)), [about_z(0.0), about_z(0.3)])
    assert features(slow)[1, 4] > 0.1 and found[2, 4] < 1e-5


def test_turning_the_clip_changes_nothing_and_turning_frames_does(x64):
    clip = random_clip(3, time=4, tokens=32, dtype=np.float64)
    clip = clip.at[..., :3].add(jnp.arange(4.0)[:, None, None] * jnp.array([[[0.3, 0.1, -0.2]]]))
    rotations = jax.vmap(lambda key: jnp.linalg.qr(haar_rotation(key=key).astype(jnp.float64))[0])(
        jax.random.split(jax.random.key(0), 4)
    )
    rotations = rotations * jnp.sign(jnp.linalg.det(rotations))[:, None, None]
    whole = rotate_columns(clip, rotations[0]).at[..., :3].add(jnp.array([5.0, -2.0, 1.0]))
    each = jnp.stack([rotate_columns(frame, rotation) for frame, rotation in zip(clip, rotations, strict=True)])
    np.testing.assert_allclose(features(whole), features(clip), atol=1e-10)
    assert np.abs(features(each) - features(clip)).max() > 0.1


EVERY = dataclasses.replace(MOVING, shape_features=True, flight_features=True, spectrum_features=True)


def test_a_frame_without_tokens_is_as_if_not_recorded():
    clip, _ = flight(np.full((3, 3), 0.2))
    mask = jnp.ones(clip.shape[:2], bool).at[2].set(False)
    found = features(clip, mask, EVERY)
    assert (found[2] == 0).all()
    np.testing.assert_allclose(found[[0, 1, 3]], features(clip[jnp.array([0, 1, 3])], config=EVERY), atol=1e-6)


def test_no_feature_sees_rotation_order_or_size(x64):
    clip = random_clip(4, time=20, tokens=24, dtype=np.float64)
    rotation = jnp.linalg.qr(haar_rotation(key=jax.random.key(2)).astype(jnp.float64))[0]
    turned = rotate_columns(clip, rotation * jnp.linalg.det(rotation))[:, ::-1].at[..., :3].multiply(3.0)
    here = features(clip, config=EVERY)
    assert here.shape == (20, feature_count(EVERY)) and np.isfinite(here).all() and np.abs(here).max() < 20
    np.testing.assert_allclose(features(turned, config=EVERY), here, atol=1e-8)
    assert np.abs(features(clip.at[..., 0].multiply(2.0), config=EVERY) - here).max() > 0.1


def test_shape_of_a_known_body():
    points = jnp.array([[2.0, 0, 0], [-2.0, 0, 0], [0, 1, 0], [0, -1, 0]])
    share, moment = jnp.full(4, 0.25), jnp.diag(jnp.array([2.0, 0.5, 0.0]))
    found = np.asarray(shape_features(points, jnp.ones(4, bool), share, moment))
    np.testing.assert_allclose(found[:5], [2**0.5, 0.5**0.5, 1e-3, 0.5, 1e-3 / 2**0.5], atol=1e-5)
    np.testing.assert_allclose(found[5:9], [1, 1.5, 2, 2], atol=1e-5)
    np.testing.assert_allclose(found[9:], [0, 0, (16 + 1) / 2 / (2 * 2.5**2)], atol=1e-5)


def test_a_swing_is_found_at_its_frequency():
    t = np.arange(WINDOW)
    window = np.zeros((WINDOW, SHAPE_FEATURES), np.float32)
    window[:, 3] = 2 + 0.3 * np.sin(2 * np.pi * 5 * t / WINDOW)
    found = np.asarray(spectrum_features(jnp.asarray(window), jnp.asarray(40.0))).reshape(-1, SHAPE_FEATURES) / 5
    assert found[:8].argmax() == 4 * SHAPE_FEATURES + 3
    np.testing.assert_allclose(found[[4, 8], 3], [0.3, 0.3 / 2**0.5], rtol=1e-4)
    assert np.delete(found, 3, axis=1).max() < 1e-3


def test_the_classifier_reads_them():
    model, (clip, _) = MambaSplat(MOVING, key=jax.random.key(0)), flight(np.full((2, 3), 0.2))
    mask = jnp.ones(clip.shape[:2], bool)
    still = clip.at[..., :3].add(-clip[..., :3].mean(axis=1, keepdims=True))
    logits = jax.jit(lambda clip: model(clip, mask))
    assert jnp.abs(logits(clip) - logits(still)).max() > 1e-4


def test_a_clip_at_rest_has_finite_gradients():
    clip = jnp.broadcast_to(random_clip(1, time=1, tokens=8), (3, 8, 14))
    mask = jnp.ones((3, 8), bool)
    slope = jax.jit(jax.grad(lambda clip: jnp.sum(normalise_clip(clip, mask, MOVING).extra ** 2)))
    assert jnp.isfinite(slope(clip)).all() and jnp.isfinite(slope(jnp.zeros_like(clip))).all()


def test_floaters_do_not_change_the_robust_scale():
    clip = random_clip(5, time=2, tokens=40)
    far, ratio = clip.at[0, 0, :3].add(30.0), {}
    for name in ("robust", "clip"):
        config = MambaSplatConfig(mode="C", scale_normalisation=name, metric_size=True)
        ratio[name] = float(np.exp(features(far, config=config) - features(clip, config=config))[1, 0])
    assert ratio["robust"] < 1.5 and ratio["clip"] > 2


def test_a_thin_body_keeps_the_digits_of_its_thickness():
    """A solver's eigenvalues are rounded by 1e-7 of the largest, which is a tenth of this body's smallest."""
    points = np.random.default_rng(0).normal(size=(200, 3)) * [1.0, 0.3, 1e-3]
    turned = (points @ np.asarray(haar_rotation(key=jax.random.key(0)), np.float64).T).astype(np.float32)
    exact = np.linalg.svd(turned.astype(np.float64), compute_uv=False) ** 2 / 200
    share = jnp.full(200, 1 / 200, jnp.float32)
    found = principal_variances(jnp.asarray(turned), share, jnp.asarray(turned.T @ turned / 200))
    np.testing.assert_allclose(found, exact, rtol=1e-5)


def test_small_steps_far_from_the_origin():
    """Places are multiples of 2⁻¹², so that the way to a kilometre off is exact, and so is what is left there.

    A mean there is rounded by 3e-5 of the object's radius, in each place where a compiler repeats it.
    """
    rng = np.random.default_rng(0)
    clip = np.array(random_clip(0, time=4, tokens=48, dtype=np.float32))
    cloud, steps = rng.integers(-(2**11), 2**11, (48, 3)), rng.integers(-40, 40, (4, 1, 3)).cumsum(axis=0)
    clip[..., :3] = (cloud + steps) / 2**12
    far = clip.copy()
    far[..., :3] += [1024, -512, 256]
    near, away = (features(jnp.asarray(one), config=EVERY) for one in (clip, far))
    np.testing.assert_allclose(away, near, atol=1e-4)
