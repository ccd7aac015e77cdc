"""What weight decay touches, and the first step."""

from __future__ import annotations

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from aerojax.core.errors import UserError
from aerojax.training.optimisers import OptimiserConfig, adamw, decays

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
        optimiser = adamw(replace(CONFIG, weight_decay=decay), steps=10)
        changes.append(optimiser.update(gradient, optimiser.init(parameters), parameters)[0])
    rate = 0.01 * CONFIG.learning_rate  # the first step of the warm-up
    np.testing.assert_allclose(changes[1]["weight"] - changes[0]["weight"], -0.5 * rate, rtol=1e-3)
    np.testing.assert_array_equal(changes[1]["bias"], changes[0]["bias"])


def test_one_step_is_a_run():
    optimiser = adamw(CONFIG, steps=1)
    change, _ = optimiser.update(
        {"a": jnp.ones((2, 2))}, optimiser.init({"a": jnp.ones((2, 2))}), {"a": jnp.ones((2, 2))}
    )
    assert np.isfinite(change["a"]).all() and (np.asarray(change["a"]) < 0).all()


def test_a_named_group_learns_more_slowly():
    parameters = {"backbone": {"weight": jnp.ones((3, 2))}, "head": {"weight": jnp.ones((3, 2))}}
    gradient = {"backbone": {"weight": jnp.ones((3, 2))}, "head": {"weight": jnp.ones((3, 2))}}
    optimiser = adamw(replace(CONFIG, slow="backbone", slow_rate=0.1), steps=10)
    change, _ = optimiser.update(gradient, optimiser.init(parameters), parameters)
    np.testing.assert_allclose(change["backbone"]["weight"], 0.1 * change["head"]["weight"], rtol=1e-5)
    with pytest.raises(UserError, match="slow=spine is in no name of 2 parameters"):
        adamw(replace(CONFIG, slow="spine"), steps=10).init(parameters)
