"""The convolution of the 2D baselines is XLA's, and its gradients are, too."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from aerojax.classify.images.convolutions import Convolution


def of_xla(layer: Convolution, x: jax.Array) -> jax.Array:
    layout = ("NHWC", "HWIO", "NHWC")
    y = jax.lax.conv_general_dilated(x[None], layer.weight[...], (1, 1), "SAME", dimension_numbers=layout)[0]
    return y + layer.bias[...].reshape(1, 1, -1)


@pytest.mark.parametrize("shape", [(8, 6, 3), (1, 5, 4), (2, 1, 1)])
def test_the_nine_products_are_a_convolution(shape):
    layer = Convolution(shape[-1], 5, key=jax.random.key(0))
    layer.bias[...] = jnp.arange(5.0)
    x = jax.random.normal(jax.random.key(1), shape)
    np.testing.assert_allclose(layer(x), of_xla(layer, x), atol=2e-6)
    ours, theirs = (jax.grad(lambda x, f=f: (f(x) ** 2).sum())(x) for f in (layer, lambda x: of_xla(layer, x)))
    np.testing.assert_allclose(ours, theirs, rtol=1e-4, atol=1e-4)


def test_a_turned_kernel_is_another_one():
    """So that the comparison above can fail: rows and columns are not exchanged."""
    layer = Convolution(2, 3, key=jax.random.key(0))
    x = jax.random.normal(jax.random.key(1), (6, 6, 2))
    before = layer(x)
    layer.weight[...] = layer.weight[...].swapaxes(0, 1)
    assert np.abs(layer(x) - before).max() > 0.1
