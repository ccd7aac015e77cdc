"""Every combination of features and bridge can be trained: it builds, and a step against the gradient helps."""

from __future__ import annotations

from functools import partial
from itertools import cycle
from typing import get_args

import jax
import jax.numpy as jnp
import pytest
from support.clip_examples import random_clip

from aerojax.classify.mambasplat.config import Bridge, MambaSplatConfig, Mode, published_config
from aerojax.classify.mambasplat.model import MambaSplat

TINY = {"channels": 4, "heads": 2, "head_dim": 2, "depth": 1, "d_model": 8, "mamba_layers": 1, "d_state": 2}
TINY |= {"token_invariants": 4, "token_features": 4}
PAIRS = list(zip(cycle(get_args(Mode)), get_args(Bridge), strict=False))  # each bridge once, each mode at least once


def loss(model: MambaSplat) -> jax.Array:
    mask = jnp.ones((3, 16), bool).at[2, 10:].set(False)
    return -jax.nn.log_softmax(model(random_clip(0, time=3, tokens=16), mask))[1]


@jax.jit
def step(model: MambaSplat) -> tuple[jax.Array, jax.Array, jax.Array]:
    before, gradient = jax.value_and_grad(loss)(model)
    size = jnp.sqrt(sum(jnp.sum(leaf**2) for leaf in jax.tree.leaves(gradient)))
    moved = jax.tree.map(lambda leaf, slope: leaf - 1e-3 / size * slope, model, gradient)
    return before, size, loss(moved)


def assert_a_step_helps(config: MambaSplatConfig) -> None:
    before, size, after = step(MambaSplat(config, key=jax.random.key(0)))
    assert jnp.isfinite(size) and size > 0 and after < before


@pytest.mark.parametrize(("mode", "bridge"), PAIRS)
def test_each_mode_and_each_bridge_learns(mode, bridge):
    readout = "last" if bridge in ("gram", "vn_std") else "mean"
    assert_a_step_helps(MambaSplatConfig(mode=mode, bridge=bridge, readout=readout, **TINY))


def test_without_time_it_learns():
    assert_a_step_helps(MambaSplatConfig(temporal="none", **TINY))


@pytest.mark.parametrize("variant", ["exact", pytest.param("published", marks=pytest.mark.long)])
@pytest.mark.parametrize("bridge", get_args(Bridge))
def test_all_combinations_have_a_gradient_of_their_own_shape(variant, bridge):
    for mode in get_args(Mode):
        if variant == "exact":
            config = MambaSplatConfig(mode=mode, bridge=bridge, **TINY)
        else:
            sizes = {name: value for name, value in TINY.items() if not name.startswith("token_")}
            config = published_config(mode, bridge=bridge, **sizes)
        model = jax.eval_shape(partial(MambaSplat, config), key=jax.random.key(0))
        value, gradient = jax.eval_shape(jax.value_and_grad(loss), model)
        assert value.shape == ()
        assert [g.shape for g in jax.tree.leaves(gradient)] == [m.shape for m in jax.tree.leaves(model)]
