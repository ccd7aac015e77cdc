"""A stream of 512 frames: scan, recurrence and step agree, a step costs the same at any time, padding is not seen."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.clip_examples import random_clip

from aerojax.classify.mambasplat.config import MambaSplatConfig
from aerojax.classify.mambasplat.mamba import MambaMixer, MambaStack
from aerojax.classify.mambasplat.model import MambaSplat

TINY = MambaSplatConfig(depth=1, mamba_layers=2, d_model=16, token_features=8, scale_normalisation="frame")
FRAMES = 512


def recurrence(mixer, u):
    """One mixer by its defining equations in double precision, a frame at a time (Gu & Dao 2023, Eq. 2 and Alg. 2)."""
    get = lambda parameter: np.asarray(parameter[...], np.float64)  # noqa: E731
    inner, taps = get(mixer.conv_weight).shape
    states, rank = get(mixer.A_log).shape[1], get(mixer.dt_weight).shape[1]
    silu = lambda v: v / (1 + np.exp(-v))  # noqa: E731
    window, memory, rows = np.zeros((taps, inner)), np.zeros((inner, states)), []
    for frame in np.asarray(u, np.float64):
        x, z = np.split(get(mixer.in_proj.weight) @ frame, 2)
        window = np.vstack([window[1:], x])
        x = silu((window * get(mixer.conv_weight).T).sum(axis=0) + get(mixer.conv_bias))
        low, B, C = np.split(get(mixer.x_proj.weight) @ x, [rank, rank + states])
        dt = np.log1p(np.exp(get(mixer.dt_weight) @ low + get(mixer.dt_bias)))
        memory = np.exp(-dt[:, None] * np.exp(get(mixer.A_log))) * memory + np.outer(dt * x, B)
        rows.append(get(mixer.out_proj.weight) @ ((memory @ C + get(mixer.D) * x) * silu(z)))
    return np.array(rows)


def test_the_scan_is_the_recurrence_over_512_frames():
    mixer = MambaMixer(TINY, key=jax.random.key(0))
    u = jax.random.normal(jax.random.key(1), (FRAMES, TINY.d_model))
    np.testing.assert_allclose(jax.jit(lambda u: mixer(u))(u), recurrence(mixer, u), atol=1e-5)


def test_512_steps_are_the_scan_at_one_cost():
    stack = MambaStack(TINY, key=jax.random.key(0))
    hidden = jax.random.normal(jax.random.key(1), (FRAMES, TINY.d_model))
    step = jax.jit(stack.step)
    state, rows = stack.initial_state(), []
    shapes = jax.tree.map(jnp.shape, state)
    for frame in np.asarray(hidden):
        row, state = step(frame, state)
        rows.append(row)
    np.testing.assert_allclose(jnp.stack(rows), jax.jit(lambda h: stack(h))(hidden), atol=1e-5)
    # One program for every frame, and nothing that grows: a step costs what the first one did.
    assert step._cache_size() == 1
    assert jax.tree.map(jnp.shape, state) == shapes
    taps, inner = TINY.d_conv - 1, TINY.expand * TINY.d_model
    assert sum(leaf.size for leaf in jax.tree.leaves(state)) == TINY.mamba_layers * inner * (taps + TINY.d_state)


@pytest.fixture(scope="module")
def stream():
    """A model and its compiled step, a function of its own: programs are counted by function, whoever compiled them."""
    model = MambaSplat(TINY, key=jax.random.key(0))
    return model, jax.jit(lambda model, state, columns, mask: model.step(columns, mask, state))


def test_a_frame_without_tokens_leaves_the_state_alone(stream):
    model, step = stream
    clip, real, none = random_clip(0, time=2, tokens=16), jnp.ones(16, bool), jnp.zeros(16, bool)
    before, state = step(model, model.initial_state(), clip[0], real)
    logits, after = step(model, state, clip[1], none)
    for a, b in zip(jax.tree.leaves(state), jax.tree.leaves(after), strict=True):
        np.testing.assert_array_equal(a, b)
    np.testing.assert_allclose(logits, before, atol=1e-6)
    changed, _ = step(model, state, clip[1], real)
    assert jnp.abs(changed - before).max() > 1e-5
    assert step._cache_size() == 1


def test_padded_tokens_of_a_stream_are_not_seen(stream):
    model, step = stream
    clip, mask = random_clip(1, time=1, tokens=16)[0], jnp.arange(16) < 11
    logits, state = step(model, model.initial_state(), clip, mask)
    garbage = clip.at[11:].set(1e3 * random_clip(2, time=1, tokens=16)[0, 11:])
    again, other = step(model, model.initial_state(), garbage, mask)
    np.testing.assert_allclose(again, logits, atol=1e-6)
    for a, b in zip(jax.tree.leaves(state), jax.tree.leaves(other), strict=True):
        np.testing.assert_allclose(a, b, atol=1e-6)
