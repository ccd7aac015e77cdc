"""Attention over blocks of queries and frames one after another give what all at once gives, gradients too."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.clip_examples import random_clip

from aerojax.classify.mambasplat import model as mambasplat
from aerojax.classify.mambasplat.config import MambaSplatConfig
from aerojax.classify.mambasplat.encoder import attend
from aerojax.classify.mambasplat.model import MambaSplat


def softmax_attention(q, k, v, mask):
    scores = jnp.where(mask, jnp.einsum("hnf,hmf->hnm", q, k), -1e30)
    return jnp.einsum("hnm,hmf->hnf", jax.nn.softmax(scores, axis=-1), v)


@pytest.mark.parametrize("valid", [13, 10, 1, 0])
@pytest.mark.parametrize("block", [16, 13, 4])
def test_attention_and_its_gradient_are_those_of_a_softmax(x64, block, valid):
    q, k, v, g = jax.random.normal(jax.random.key(0), (4, 2, 13, 6), dtype=jnp.float64)
    mask = jnp.arange(13) < valid
    ours, pull = jax.vjp(jax.jit(lambda q, k, v: attend(4 * q, k, v, mask, block)), q, k, v)
    expected, expected_pull = jax.vjp(lambda q, k, v: softmax_attention(4 * q, k, v, mask), q, k, v)
    np.testing.assert_allclose(ours, expected, atol=1e-12)
    # Where no token is valid, only the values have a gradient: what the scores would get is not used.
    wanted = range(3) if valid else (2,)
    for n in wanted:
        np.testing.assert_allclose(pull(g)[n], expected_pull(g)[n], atol=1e-11)


def test_scores_of_any_size_stay_finite():
    q, k, v = 1e3 * jax.random.normal(jax.random.key(2), (3, 1, 8, 4))
    value, gradient = jax.value_and_grad(lambda q: jnp.sum(attend(q, k, v, jnp.arange(8) < 6, 3)))(q)
    assert jnp.isfinite(value) and jnp.all(jnp.isfinite(gradient))


@pytest.mark.long
def test_large_frames_have_the_logits_of_small_ones(monkeypatch):
    model = MambaSplat(MambaSplatConfig(depth=1, mamba_layers=1, d_model=16, token_features=8), key=jax.random.key(0))
    clip, mask = random_clip(0, time=2, tokens=24), jnp.ones((2, 24), bool).at[1, 20:].set(False)
    # A function of its own each time, because a compiled one would not read the limit again.
    at_once = jax.jit(lambda model: model(clip, mask))
    loops = at_once.lower(model).as_text().count("stablehlo.while")
    logits = at_once(model)
    monkeypatch.setattr(mambasplat, "LARGE_FRAME", 8)
    apart = jax.jit(lambda model: model(clip, mask))
    assert apart.lower(model).as_text().count("stablehlo.while") == loops + 1
    np.testing.assert_allclose(apart(model), logits, atol=1e-6)
