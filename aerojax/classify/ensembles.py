"""Ensembling over subsets of a frame's tokens: the same network reads each subset, their probabilities are averaged."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float


def token_ensembles(
    columns: Float[Array, "*time token 14"], tokens: int, ensembles: int
) -> Float[Array, "ensemble *time some 14"]:
    """Disjoint subsets of `tokens` tokens each, the first ones of every frame, which lie in random order.

    There are `ensembles` of them as far as the tokens suffice, and at least one; a frame with fewer than `tokens` is
    one subset.
    """
    available = columns.shape[-2]
    size, count = min(tokens, available), max(1, min(ensembles, available // tokens))
    cut = columns[..., : count * size, :].reshape(*columns.shape[:-2], count, size, 14)
    return jnp.moveaxis(cut, -3, 0)


def calibrated_answer(logits: Float[Array, "ensemble *time label"], temperature: float) -> Float[Array, "*time label"]:
    """Log-probabilities of the ensembles' mean, sharpened or blunted by the card's temperature (Guo et al. 2017)."""
    mean = log_mean_probability(logits)
    return mean if temperature == 1.0 else jax.nn.log_softmax(mean / temperature, axis=-1)


def log_mean_probability(logits: Float[Array, "ensemble *time label"]) -> Float[Array, "*time label"]:
    """Logarithm of the ensembles' mean softmax."""
    mean = jax.nn.logsumexp(jax.nn.log_softmax(logits, axis=-1), axis=0)
    return mean - jnp.log(jnp.asarray(logits.shape[0], logits.dtype))
