"""Parameters and operations: the published totals, and ours against the matrix products of the traced program."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import pytest
from support.traced_programs import matrix_products

from aerojax.classify.mambasplat.config import MambaSplatConfig, published_config
from aerojax.classify.mambasplat.cost import operations, parameter_count, published_operations, unused_bridge_parameters
from aerojax.classify.mambasplat.model import MambaSplat
from aerojax.core.errors import UserError

TOTALS = [
    ({"mode": "C"}, 1_852_478),
    ({"mode": "C_O"}, 1_859_646),
    ({"mode": "C_SH"}, 1_873_982),
    ({"mode": "C_S_R"}, 1_852_520),
    ({"mode": "C_O_S_R"}, 1_859_688),
    ({"mode": "X"}, 1_881_192),
    ({"d_model": 64}, 208_200),
    ({"d_model": 128}, 556_968),
    ({"d_model": 512}, 7_036_392),
    ({"mamba_layers": 1}, 566_376),
    ({"mamba_layers": 2}, 1_004_648),
    ({"mamba_layers": 8}, 3_634_280),
]


@pytest.mark.parametrize(("changes", "total"), TOTALS)
def test_totals_are_those_of_the_released_code(changes, total):
    config = published_config(**changes)
    assert parameter_count(config) + unused_bridge_parameters(config) == total


def test_ours_has_no_unused_bridge():
    assert parameter_count(published_config("X")) == 1_853_922
    assert unused_bridge_parameters(MambaSplatConfig()) == 0


@pytest.mark.parametrize(
    ("mode", "frames", "tokens", "billions"),
    [("X", 8, 1024, 34.51), ("X", 16, 1024, 69.03), ("C_O_S_R", 24, 1024, 59.21)],
)
def test_published_operations_are_those_of_the_thesis(mode, frames, tokens, billions):
    assert round(published_operations(published_config(mode), frames, tokens) / 1e9, 2) == billions
    assert operations(published_config(mode), frames, tokens) == published_operations(
        published_config(mode), frames, tokens
    )


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"mode": "C"},
        {"mode": "C_SH", "scalar_slots": 2},
        {"mode": "C_O_S_R", "lifting": "columns"},
        {"bridge": "gram", "invariants_before_pooling": False},
        {"bridge": "vn_std", "metric_size": True},
        {"temporal": "none", "depth": 2},
    ],
)
def test_exact_operations_are_the_matrix_products_of_the_program(changes):
    config, frames, tokens = MambaSplatConfig(**changes), 5, 24
    model = jax.eval_shape(lambda key: MambaSplat(config, key=key), jax.random.key(0))
    columns, mask = (
        jax.ShapeDtypeStruct((frames, tokens, 14), jnp.float32),
        jax.ShapeDtypeStruct((frames, tokens), bool),
    )
    traced = jax.make_jaxpr(lambda model, columns, mask: model(columns, mask))(model, columns, mask)
    # Products with one vector that the convention counts: the head, the scan's read-out, the convolution (taps that are
    # added up), and Σp, Σ²p of covariance lifting.
    d, inner = config.d_model, config.expand * config.d_model
    vectors = d * d // 2 + d // 2 * config.classes
    if config.temporal == "mamba":
        convolution = (frames + config.d_conv - 1) * inner * config.d_conv
        vectors += config.mamba_layers * (convolution + frames * inner * config.d_state)
    shape = config.mode in ("C_S_R", "C_O_S_R", "X")
    vectors += 18 * frames * tokens * (shape and config.lifting == "covariance")
    # The mask rides on the scores as one more feature, which the convention does not know.
    mask_feature = frames * config.depth * config.heads * tokens**2
    assert operations(config, frames, tokens) == 2 * (matrix_products(traced.jaxpr) + vectors - mask_feature)


def test_merged_tokens_cost_what_so_many_tokens_do_but_for_their_covariances():
    merged, plain = operations(MambaSplatConfig(merged_tokens=64), 5, 512), operations(MambaSplatConfig(), 5, 64)
    mass, own_covariance = 14, 27
    assert merged - plain == 2 * 5 * 64 * (mass - own_covariance)


def test_what_the_published_formula_does_not_describe_is_refused():
    with pytest.raises(UserError, match="bridge 'vn_in'"):
        operations(published_config("X", bridge="gram"), 4, 8)
