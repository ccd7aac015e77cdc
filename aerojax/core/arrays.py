"""Functions of NumPy and JAX arrays alike."""

from __future__ import annotations

from types import ModuleType
from typing import TypeVar

import jax
import jax.numpy as jnp
import numpy as np

AnyArray = TypeVar("AnyArray", np.ndarray, jax.Array)
"""Either kind of array, the same for all arguments and results: `Float[AnyArray, "point 3"]`."""


def namespace(x: np.ndarray | jax.Array) -> ModuleType:
    """The array module of `x`: `numpy`, which computes in its precision on the host, or `jax.numpy`."""
    return jnp if isinstance(x, jax.Array) else np


def pairwise_sum(x: jax.Array, axis: int = 0) -> jax.Array:
    """Sum over an axis by halves: rounding grows with the logarithm of the length (Higham 2002, §4.1).

    Compilers add in what order they like, often one after the other, where it grows with the length's root or worse.
    """
    x = jnp.moveaxis(x, axis, 0)
    while (count := x.shape[0]) > 1:
        half = count // 2
        added = x[:half] + x[half : 2 * half]
        x = jnp.concatenate([added, x[2 * half :]]) if count % 2 else added
    return x[0]
