"""What weight decay touches, and the first step."""

from __future__ import annotations

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from aerojax.core.errors import UserError
from aerojax.training.optimisers import OptimiserConfig, decays, learning_rate, optimiser_of

CONFIG = OptimiserConfig(learning_rate=0.05)


def test_weight_decay_spares_vectors_and_state_matrices():
    leaf = jnp.zeros
    parameters = {
        "head": {"weight": leaf((4, 3)), "bias": leaf(4)},
        "blocks": {"weight": leaf((2, 4, 3)), "gain": leaf((2, 4))},
        "temporal": {"layers": {"A_log": leaf((2, 8, 16)), "D": leaf((2, 8)), "in": leaf((2, 8, 8))}},
    }
    assert decays(parameters) == {
        "head": {"weight": True, "bias": False},
        "blocks": {"weight": True, "gain": False},
        "temporal": {"layers": {"A_log": False, "D": False, "in": True}},
    }


def test_decay_moves_only_what_decays():
    parameters, gradient = (
        {"weight": jnp.ones((3, 2)), "bias": jnp.ones(3)},
        {"weight": jnp.ones((3, 2)), "bias": -jnp.ones(3)},
    )
    changes = []
    for decay in (0.0, 0.5):
        optimiser = optimiser_of(replace(CONFIG, weight_decay=decay), steps=10)
        changes.append(optimiser.update(gradient, optimiser.init(parameters), parameters)[0])
    rate = 0.01 * CONFIG.learning_rate  # the first step of the warm-up
    np.testing.assert_allclose(changes[1]["weight"] - changes[0]["weight"], -0.5 * rate, rtol=1e-3)
    np.testing.assert_array_equal(changes[1]["bias"], changes[0]["bias"])


def test_one_step_is_a_run():
    optimiser = optimiser_of(CONFIG, steps=1)
    change, _ = optimiser.update(
        {"a": jnp.ones((2, 2))}, optimiser.init({"a": jnp.ones((2, 2))}), {"a": jnp.ones((2, 2))}
    )
    assert np.isfinite(change["a"]).all() and (np.asarray(change["a"]) < 0).all()


def test_a_named_group_learns_more_slowly():
    parameters = {"backbone": {"weight": jnp.ones((3, 2))}, "head": {"weight": jnp.ones((3, 2))}}
    gradient = {"backbone": {"weight": jnp.ones((3, 2))}, "head": {"weight": jnp.ones((3, 2))}}
    optimiser = optimiser_of(replace(CONFIG, slow="backbone", slow_rate=0.1), steps=10)
    change, _ = optimiser.update(gradient, optimiser.init(parameters), parameters)
    np.testing.assert_allclose(change["backbone"]["weight"], 0.1 * change["head"]["weight"], rtol=1e-5)
    with pytest.raises(UserError, match="slow=spine is in no name of 2 parameters"):
        optimiser_of(replace(CONFIG, slow="spine"), steps=10).init(parameters)


def test_milestones_divide_the_rate():
    """The recipe of MSR-Action3D: warm-up over a fifth of the run, a tenth of the rate from 40 and from 60 % on."""
    config = OptimiserConfig(learning_rate=0.5, warmup=0.2, milestones=(0.4, 0.6))
    rate = learning_rate(config, steps=100)
    found = [float(rate(step)) for step in (0, 10, 20, 39, 40, 59, 60, 99)]
    np.testing.assert_allclose(found, [0.005, 0.5 * 0.505, 0.5, 0.5, 0.05, 0.05, 0.005, 0.005], rtol=1e-5)
    with pytest.raises(UserError, match="milestones is"):
        OptimiserConfig(milestones=(0.5, 20.0))


def test_two_steps_of_sgd_by_hand():
    config = replace(CONFIG, rule="sgd", learning_rate=1.0, warmup=0.2, weight_decay=0.5, clip_norm=0.0)
    optimiser = optimiser_of(config, steps=10)
    parameters, gradient = {"weight": jnp.ones((2, 2)), "bias": jnp.ones(2)}, {"weight": 2.0, "bias": 2.0}
    gradient = {name: value * jnp.ones_like(parameters[name]) for name, value in gradient.items()}
    first, state = optimiser.update(gradient, optimiser.init(parameters), parameters)
    # The rate of the first step is a hundredth of the peak, of the second 0.505; biases do not decay.
    np.testing.assert_allclose(first["weight"], -0.01 * (2 + 0.5), rtol=1e-5)
    np.testing.assert_allclose(first["bias"], -0.01 * 2, rtol=1e-5)
    moved = {name: parameters[name] + first[name] for name in parameters}
    second, _ = optimiser.update(gradient, state, moved)
    np.testing.assert_allclose(second["weight"], -0.505 * (0.9 * 2.5 + 2 + 0.5 * 0.975), rtol=1e-5)
    np.testing.assert_allclose(second["bias"], -0.505 * (0.9 * 2 + 2), rtol=1e-5)
