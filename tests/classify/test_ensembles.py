"""Token ensembles: disjoint subsets, as many as there are tokens for, and the mean of their probabilities."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from aerojax.classify.ensembles import calibrated_answer, log_mean_probability, token_ensembles


@pytest.mark.parametrize(
    ("tokens", "ensembles", "count", "size"), [(4, 2, 2, 4), (4, 9, 2, 4), (5, 2, 2, 5), (6, 2, 1, 6), (12, 3, 1, 10)]
)
def test_subsets_are_disjoint_and_as_many_as_fit(tokens, ensembles, count, size):
    columns = jnp.broadcast_to(jnp.arange(10.0)[None, :, None], (3, 10, 14))
    found = np.asarray(token_ensembles(columns, tokens, ensembles))
    assert found.shape == (count, 3, size, 14)
    np.testing.assert_array_equal(found[:, 1, :, 0].ravel(), np.arange(count * size))
    np.testing.assert_array_equal(token_ensembles(columns[0], tokens, ensembles), found[:, 0])


def test_probabilities_are_averaged_not_logits():
    logits = jnp.array([[0.0, 50.0], [0.0, -50.0]])
    np.testing.assert_allclose(jnp.exp(log_mean_probability(logits)), [0.5, 0.5], atol=1e-6)
    one = jnp.array([[1.0, 2.0, -1.0]])
    np.testing.assert_allclose(log_mean_probability(one), jax.nn.log_softmax(one[0]), atol=1e-6)


def test_the_temperature_sharpens_the_answer_and_keeps_its_order():
    logits = jnp.log(jnp.array([[[0.6, 0.3, 0.1]], [[0.2, 0.5, 0.3]]]))
    plain = calibrated_answer(logits, 1.0)
    np.testing.assert_array_equal(plain, log_mean_probability(logits))
    powers = jnp.exp(plain) ** 2  # p^(1/T), normalised
    np.testing.assert_allclose(jnp.exp(calibrated_answer(logits, 0.5)), powers / powers.sum(), atol=1e-6)
