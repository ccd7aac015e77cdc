"""Saliency is the gradient that it says, turns with nothing, and deletion does what it says."""

from __future__ import annotations

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.clip_examples import random_clip, rotate_columns

from aerojax.classify.base import untrained
from aerojax.classify.mambasplat.config import MambaSplatConfig
from aerojax.core.types import Evidence, Gaussians
from aerojax.evaluate.saliency import SHARES, explanation, saliency_of, without_gaussians
from aerojax.geometry.rotations import haar_rotation

TIME, TOKENS = 3, 12
MODEL = MambaSplatConfig(depth=1, mamba_layers=1, d_model=16, scale_normalisation="clip")
VALID = jnp.array([True, True, False])


@pytest.fixture(scope="module")
def classifier():
    return untrained(MODEL, tokens=TOKENS, frames=TIME, token_ensembles=1, key=jax.random.key(0))


def clip(seed: int = 0) -> Gaussians:
    return Gaussians.from_columns(random_clip(seed, TIME, TOKENS))


def test_saliency_is_the_slope_of_the_answer(classifier):
    found = saliency_of(classifier, Evidence(clip()), VALID)
    assert (found.gaussians[:2] > 0).all() and not found.gaussians[2].any() and found.frames[2] == 0
    np.testing.assert_allclose(found.frames[:2], np.linalg.norm(found.gaussians[:2], axis=1), rtol=1e-6)

    def answer(mean):
        logits = classifier.clip(Evidence(replace(clip(), mean=mean)), VALID)[-1]
        return float(jax.nn.log_softmax(logits)[found.label])

    mean, step, slopes = clip().mean, 1e-2, []
    for axis in range(3):
        ends = [answer(mean.at[0, 4, axis].add(sign * step)) for sign in (1, -1)]
        slopes.append((ends[0] - ends[1]) / (2 * step))
    centred = np.asarray(mean)[:2] - np.asarray(mean)[:2].mean(axis=1, keepdims=True)
    radius = np.sqrt(np.mean(np.sum(centred**2, axis=-1)))
    assert found.gaussians[0, 4] == pytest.approx(np.linalg.norm(slopes) * radius, rel=0.05)


def test_saliency_turns_with_nothing(classifier):
    still = saliency_of(classifier, Evidence(clip()), VALID)
    columns = rotate_columns(clip().columns(), haar_rotation(key=jax.random.key(3)))
    turned = saliency_of(classifier, Evidence(Gaussians.from_columns(columns)), VALID)
    np.testing.assert_allclose(turned.gaussians, still.gaussians, rtol=1e-2, atol=1e-4)
    assert turned.label == still.label


def test_what_is_deleted_is_replaced_by_what_is_left():
    score = np.tile(np.arange(TOKENS, dtype=float), (TIME, 1))
    left = without_gaussians(Evidence(clip()), score, 0.75).gaussians
    assert {tuple(row) for row in np.asarray(left.mean[0])} == {tuple(row) for row in np.asarray(clip().mean[0, :3])}
    kept = without_gaussians(Evidence(clip()), score, 0.75, most=False).gaussians
    assert {tuple(row) for row in np.asarray(kept.mean[0])} == {tuple(row) for row in np.asarray(clip().mean[0, -3:])}
    same = without_gaussians(Evidence(clip()), score, 0.0).gaussians
    np.testing.assert_array_equal(same.mean, clip().mean)
    assert without_gaussians(Evidence(clip()), score, 1.0).gaussians.mean.shape == clip().mean.shape


def test_an_explanation_begins_with_the_answer(classifier):
    found = explanation(classifier, Evidence(clip()))
    assert found["shares"] == list(SHARES) and len(found["without_frames"]) == TIME
    for curve in ("deletion", "random", "without_frames"):
        assert found[curve][0] == pytest.approx(found["probability"], abs=1e-5)
    assert found["insertion"][0] != pytest.approx(found["probability"], abs=1e-5)  # one Gaussian a frame is left
    assert np.shape(found["gaussians"]) == (TIME, TOKENS)
