"""Numbers that networks start with: one long random vector, taken piece by piece.

A draw for each of hundreds of parameters would be hundreds of programs to compile.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TypeVar

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Key

_T = TypeVar("_T")
MOST_NUMBERS = 1 << 30


class Draws:
    """Uniform numbers in [-1, 1), each handed out once."""

    def __init__(self, numbers: Float[Array, "number"]):
        self.numbers, self.used = numbers, 0

    def uniform(self, shape: tuple[int, ...], bound: float) -> Float[Array, "*shape"]:
        """Uniform numbers in [-bound, bound)."""
        return bound * self.take(math.prod(shape)).reshape(shape)

    def normal(self, shape: tuple[int, ...], deviation: float) -> Float[Array, "*shape"]:
        """Normal numbers, cut at the five deviations that float32 tells from certainty."""
        return deviation * math.sqrt(2) * jax.lax.erf_inv(self.uniform(shape, 1 - 1e-6))

    def take(self, count: int) -> Float[Array, "count"]:
        """The next numbers as they are."""
        self.used += count
        return self.numbers[self.used - count : self.used]

    def stacked(self, make: Callable[[Draws], _T], count: int) -> _T:
        """`count` equal parts of a network with numbers of their own, as one pytree with a leading axis."""
        size = _numbers_needed(make)
        rows = self.take(count * size).reshape(count, size)
        return jax.vmap(lambda row: make(Draws(row)))(rows)


def drawn(make: Callable[[Draws], _T], *, key: Key[Array, ""]) -> _T:
    """What `make` makes, compiled as a whole."""
    count = _numbers_needed(make)
    return jax.jit(lambda key: make(Draws(jax.random.uniform(key, (count,), minval=-1.0, maxval=1.0))))(key)


def _numbers_needed(make: Callable[[Draws], _T]) -> int:
    used = []

    def probe(numbers: Float[Array, "number"]) -> _T:
        draws = Draws(numbers)
        made = make(draws)
        used.append(draws.used)
        return made

    jax.eval_shape(probe, jax.ShapeDtypeStruct((MOST_NUMBERS,), jnp.float32))
    return used[0]
