"""Majority votes: every label counts once, ties go to the class whose labels were given with more confidence."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jax.typing import DTypeLike
from jaxtyping import Array, Bool, Float, Int

from aerojax.core.types import pytree_dataclass


@pytree_dataclass
class Ballot:
    """Labels so far.

    votes: how many labels each class has. confidence: sum of the probabilities that they were given with.
    """

    votes: Float[Array, "*batch label"]
    confidence: Float[Array, "*batch label"]

    def __add__(self, other: Ballot) -> Ballot:
        """Both together."""
        return jax.tree.map(jnp.add, self, other)

    def logits(self) -> Float[Array, "*batch label"]:
        """Logarithms of probabilities in the order of the vote; equal ones where there are no labels.

        Shares of the votes by the rule of succession, (n + 1)/(N + K). To its n votes a class has its confidence over
        N + 1 added, which is less than one vote.
        """
        total = self.votes.sum(axis=-1, keepdims=True)
        score = self.votes + self.confidence / (total + 1) + 1
        return jnp.log(score / score.sum(axis=-1, keepdims=True))


def empty_ballot(classes: int, kind: DTypeLike) -> Ballot:
    """No label yet."""
    return Ballot(jnp.zeros(classes, kind), jnp.zeros(classes, kind))


def cast(logits: Float[Array, "*batch voter label"], counts: Bool[Array, "*batch voter"]) -> Ballot:
    """The labels of voters, those that count."""
    probability = jax.nn.softmax(logits, axis=-1)
    chosen = jax.nn.one_hot(jnp.argmax(logits, axis=-1), logits.shape[-1], dtype=logits.dtype)
    chosen = jnp.where(counts[..., None], chosen, 0.0)
    return Ballot(chosen.sum(axis=-2), jnp.sum(chosen * probability, axis=-2))


def cast_labels(
    label: Int[Array, "voter"],
    confidence: Float[Array, "voter"],
    counts: Bool[Array, "voter"],
    group: Int[Array, "voter"],
    *,
    groups: int,
    classes: int,
) -> Ballot:
    """Labels that were given elsewhere, counted in each of so many groups of voters."""
    chosen = jnp.where(counts[:, None], jax.nn.one_hot(label, classes, dtype=confidence.dtype), 0.0)
    pairs = chosen, chosen * confidence[:, None]
    votes, sure = (jax.ops.segment_sum(each, group, num_segments=groups) for each in pairs)
    return Ballot(votes, sure)
