"""Sums by halves."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

from aerojax.core.arrays import pairwise_sum


@pytest.mark.parametrize("count", [1, 2, 7, 64, 100])
def test_it_is_a_sum(count):
    x = np.random.default_rng(count).integers(-9, 9, (3, count, 2)).astype(np.float32)
    np.testing.assert_array_equal(pairwise_sum(jnp.asarray(x), axis=1), x.sum(axis=1))


def test_it_rounds_as_often_as_there_are_halves():
    x = np.full(4096, 0.1, np.float32)
    one_by_one = np.cumsum(x)[-1]
    exact = x.astype(np.float64).sum()
    assert abs(float(pairwise_sum(jnp.asarray(x))) - exact) / exact < 1e-7 < abs(float(one_by_one) - exact) / exact
