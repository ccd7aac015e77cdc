"""Training does not see rotation augmentation: equal loss curves for an invariant model, unequal for another one."""

from __future__ import annotations

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import optax
from support.clip_examples import random_clip

from aerojax.classify.mambasplat.config import MambaSplatConfig, published_config
from aerojax.classify.mambasplat.model import MambaSplat
from aerojax.training.loop import smoothed_cross_entropy
from aerojax.training.optimisers import OptimiserConfig, optimiser_of
from aerojax.training.variation import VariationConfig, vary_clip

STEPS, BATCH = 20, 4
ROTATIONS = ("none", "z", "so3")
SMALL = {"depth": 1, "d_model": 16, "mamba_layers": 1}
CLIPS = jnp.stack([random_clip(seed, time=4, tokens=20) for seed in range(BATCH)])
LABELS = jnp.arange(BATCH) % 4


def loss_curves(config: MambaSplatConfig) -> dict[str, np.ndarray]:
    """The loss of each of 20 updates by rotation, with dropout, jitter, recolouring and warm-up as in training."""
    optimiser = optimiser_of(OptimiserConfig(learning_rate=3e-3), STEPS)
    variations = [VariationConfig(frames=3, tokens=16, jitter=0.05, rotation=rotation) for rotation in ROTATIONS]

    def loss(model, kind, key):
        keys = jax.random.split(key, (2, BATCH))
        mask = jnp.ones(4, bool)
        every = [jax.vmap(lambda c, k, v=v: vary_clip(c, mask, v, key=k))(CLIPS, keys[0]) for v in variations]
        clips, seen = (jnp.stack(parts)[kind] for parts in zip(*every, strict=True))
        logits = jax.vmap(lambda c, m, k: model(c, m, key=k))(clips, seen, keys[1])
        return smoothed_cross_entropy(logits, LABELS, 0.1).mean()

    def update(kind, state, key):
        model, moments = state
        value, gradient = jax.value_and_grad(loss)(model, kind, key)
        change, moments = optimiser.update(gradient, moments, model)
        return (optax.apply_updates(model, change), moments), value

    # One program for all rotations; optimising it would take longer than running it.
    @partial(jax.jit, compiler_options={"xla_backend_optimization_level": 0})
    def run(model, kind):
        keys = jax.random.split(jax.random.key(1), STEPS)
        return jax.lax.scan(partial(update, kind), (model, optimiser.init(model)), keys)[1]

    model = MambaSplat(config, key=jax.random.key(0))
    return {rotation: np.asarray(run(model, kind)) for kind, rotation in enumerate(ROTATIONS)}


def test_an_invariant_model_trains_the_same_on_turned_clips():
    curves = loss_curves(MambaSplatConfig(**SMALL))
    for rotation in ("z", "so3"):
        np.testing.assert_allclose(curves[rotation], curves["none"], atol=1e-4)
    assert len(curves["none"]) == STEPS and np.ptp(curves["none"]) > 0.05  # it does train


def test_the_check_catches_a_model_with_directions_of_its_own():
    curves = loss_curves(published_config(bias_epsilon=0.5, **SMALL))
    for rotation in ("z", "so3"):
        assert np.abs(curves[rotation] - curves["none"]).max() > 1e-2
