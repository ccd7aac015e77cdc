"""What an ensemble is made of."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import jax
from jaxtyping import Array, Key

from aerojax.classify.base import ClassifierConfig, require_counts
from aerojax.classify.card import Card
from aerojax.classify.mambasplat.config import MambaSplatConfig
from aerojax.core.errors import UserError

if TYPE_CHECKING:
    from aerojax.classify.ensemble.classifier import EnsembleClassifier


@dataclass(frozen=True)
class EnsembleConfig(ClassifierConfig):
    """Networks that differ by their initial weights and dropout alone (deep ensembles, Lakshminarayanan et al. 2017).

    member: what each of them is. size: how many.
    """

    name: Literal["ensemble"] = "ensemble"
    member: ClassifierConfig = field(default_factory=MambaSplatConfig)
    size: int = 3

    def __post_init__(self) -> None:
        """Refuse what cannot be built.

        Raises:
            UserError: names the field and a value that works.
        """
        require_counts(self, "size")
        if isinstance(self.member, EnsembleConfig):
            raise UserError("invalid", "member is an ensemble in EnsembleConfig", "name another kind of classifier")

    def build(self, card: Card, *, key: Key[Array, ""]) -> EnsembleClassifier:
        """A classifier with random weights and the given card."""
        # The classifier is made of this configuration, so its module cannot be imported before this one is.
        from aerojax.classify.ensemble.classifier import EnsembleClassifier

        members = jax.vmap(lambda each: self.member.build(card, key=each))(jax.random.split(key, self.size))
        return EnsembleClassifier(members, card)

    @property
    def label(self) -> str:
        """Such as 3 × MambaSplat-4D E(X), exact variant."""
        return f"{self.size} × {self.member.label}"

    @property
    def rotation_invariant(self) -> bool:
        """As the members are."""
        return self.member.rotation_invariant
