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
