"""Networks side by side behind the door of stage 3: one program for all of them, and the mean of their answers."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Key

from aerojax.classify.base import State, Trainable, with_card
from aerojax.classify.card import Card
from aerojax.classify.ensembles import calibrated_answer, log_mean_probability
from aerojax.core.types import Crops, Evidence, pytree_dataclass, static_field


@pytree_dataclass
class EnsembleClassifier:
    """A `Trainable`; every leaf of `members` has a leading axis of their number."""

    members: Trainable
    card: Card = static_field()

    @property
    def network(self) -> Any:
        """The parameters of all members."""
        return self.members.network

    @property
    def reads_crops(self) -> bool:
        """As the members do."""
        return self.members.reads_crops

    @property
    def causal(self) -> bool:
        """As the members are."""
        return self.members.causal

    def prepare(self, columns: Float[Array, "*batch token 14"]) -> Float[Array, "*batch token 14"]:
        """What each member does."""
        return self.members.prepare(columns)

    def logits(
        self, columns: Float[Array, "time token 14"], mask: Bool[Array, "time token"], crops: Crops | None = None
    ) -> Float[Array, "label"]:
        """Logarithm of the members' mean probability."""
        return log_mean_probability(jax.vmap(lambda member: member.logits(columns, mask, crops))(self._readers))

    def training_logits(
        self,
        columns: Float[Array, "time token 14"],
        mask: Bool[Array, "time token"],
        crops: Crops | None,
        *,
        key: Key[Array, ""],
    ) -> Float[Array, "head label"]:
        """The heads of one member after the other, each with dropout of its own."""
        keys = jax.random.split(key, len(jax.tree.leaves(self.members)[0]))
        heads = jax.vmap(lambda member, each: member.training_logits(columns, mask, crops, key=each))(
            self._readers, keys
        )
        return heads.reshape(-1, heads.shape[-1])

    def initial(self) -> State:
        """One state a member."""
        return jax.vmap(lambda member: member.initial())(self._readers)

    def step(self, seen: Evidence, valid: Bool[Array, ""], state: State) -> tuple[Float[Array, "label"], State]:
        """Logits after one more frame; errors as of the members."""
        logits, state = jax.vmap(lambda member, own: member.step(seen, valid, own))(self._readers, state)
        return calibrated_answer(logits, self.card.temperature), state

    def clip(self, seen: Evidence, valid: Bool[Array, "time"]) -> Float[Array, "time label"]:
        """Logits after each frame."""
        logits = jax.vmap(lambda member: member.clip(seen, valid))(self._readers)
        return calibrated_answer(logits, self.card.temperature)

    @property
    def feature_weights(self) -> tuple[float, ...]:
        """Those of the members, which count alike."""
        count = len(jax.tree.leaves(self.members)[0])
        return tuple(weight / count for weight in self.members.feature_weights) * count  # pyrefly: ignore

    def step_features(
        self, seen: Evidence, valid: Bool[Array, ""], state: State
    ) -> tuple[Float[Array, "label"], Float[Array, "row feature"], State]:
        """As `step`, with the features of the members, which have to give some."""
        logits, features, state = jax.vmap(lambda member, own: member.step_features(seen, valid, own))(
            self._readers, state
        )
        return calibrated_answer(logits, self.card.temperature), features.reshape(-1, features.shape[-1]), state

    def clip_features(
        self, seen: Evidence, valid: Bool[Array, "time"]
    ) -> tuple[Float[Array, "time label"], Float[Array, "time row feature"]]:
        """As `clip`, with the features of the members, which have to give some."""
        logits, features = jax.vmap(lambda member: member.clip_features(seen, valid))(self._readers)
        each = jnp.moveaxis(features, 0, 1)
        rows = each.reshape(each.shape[0], -1, each.shape[-1])
        return calibrated_answer(logits, self.card.temperature), rows

    @property
    def _readers(self) -> Trainable:
        """The members as this card says that they are read; the temperature is that of their mean alone."""
        return with_card(self.members, token_ensembles=self.card.token_ensembles, temperature=1.0)
