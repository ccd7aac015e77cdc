"""Attention over blocks of queries and frames one after another give what all at once gives, gradients too."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from clip_examples import random_clip

from aerojax.classify import encoder, mambasplat
from aerojax.classify.config import MambaSplatConfig
from aerojax.classify.encoder import attend, attend_in_blocks
from aerojax.classify.mambasplat import MambaSplat


@pytest.mark.parametrize("tokens", [16, 13])
def test_blocks_of_queries_are_attention(tokens):
    q, k, v, g = jax.random.normal(jax.random.key(0), (4, 2, tokens, 6))
    mask = jnp.arange(tokens) < tokens - 3
    ours, pull = jax.vjp(jax.jit(lambda q, k, v: attend_in_blocks(q, k, v, mask, block=4)), q, k, v)
    expected, expected_pull = jax.vjp(lambda q, k, v: attend(q, k, v, mask), q, k, v)
    np.testing.assert_allclose(ours, expected, atol=1e-6)
    for a, b in zip(pull(g), expected_pull(g), strict=True):
        np.testing.assert_allclose(a, b, atol=2e-6)


def test_large_frames_have_the_logits_of_small_ones(monkeypatch):
    model = MambaSplat(MambaSplatConfig(depth=1, mamba_layers=1, d_model=16, token_features=8), key=jax.random.key(0))
    clip, mask = random_clip(0, time=2, tokens=24), jnp.ones((2, 24), bool).at[1, 20:].set(False)
    # A function of its own each time, because a compiled one would not read the limit again.
    at_once = jax.jit(lambda model: model(clip, mask))
    loops = at_once.lower(model).as_text().count("stablehlo.while")
    logits = at_once(model)
    for module in (encoder, mambasplat):
        monkeypatch.setattr(module, "LARGE_FRAME", 8)
    apart = jax.jit(lambda model: model(clip, mask))
    assert apart.lower(model).as_text().count("stablehlo.while") == loops + 2
    np.testing.assert_allclose(apart(model), logits, atol=1e-6)
