"""MambaSplat-4D behind the door of stage 3: a network, its card, and how its frames are prepared and read."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Key

from aerojax.classify.card import Card
from aerojax.classify.ensembles import calibrated_answer, token_ensembles
from aerojax.classify.mambasplat.model import MambaSplat, StreamState
from aerojax.classify.released.normalisation import normalise_published
from aerojax.core.errors import UserError
from aerojax.core.types import Crops, Evidence, Gaussians, pytree_dataclass, static_field


@pytree_dataclass
class MambaSplatClassifier:
    """A `Trainable` of `aerojax.classify.base`; the published variant differs by `prepare` alone."""

    network: MambaSplat
    card: Card = static_field()

    @property
    def reads_crops(self) -> bool:
        """Never."""
        return False

    @property
    def causal(self) -> bool:
        """Whether no frame is read otherwise because of those behind it."""
        return self.network.config.looks_ahead is None

    def prepare(self, columns: Float[Array, "*batch token 14"]) -> Float[Array, "*batch token 14"]:
        """Whole frames as their authors prepare them for the published variant; nothing for the exact one."""
        return normalise_published(columns) if self.network.config.variant == "published" else columns

    def logits(
        self,
        columns: Float[Array, "time token 14"],
        mask: Bool[Array, "time token"],
        crops: Crops | None = None,
    ) -> Float[Array, "label"]:
        """The network's logits of one clip of prepared tokens."""
        return self.network(columns, mask)

    def training_logits(
        self,
        columns: Float[Array, "time token 14"],
        mask: Bool[Array, "time token"],
        crops: Crops | None,
        *,
        key: Key[Array, ""],
    ) -> Float[Array, "head label"]:
        """The same of its only head, with dropout."""
        return self.network(columns, mask, key=key)[None]

    def initial(self) -> StreamState:
        """The network's state before the first frame, once for each ensemble."""
        state = self.network.initial_state()
        return jax.tree.map(lambda leaf: jnp.stack([leaf] * self.card.token_ensembles), state)

    def step(
        self, seen: Evidence, valid: Bool[Array, ""], state: StreamState
    ) -> tuple[Float[Array, "label"], StreamState]:
        """Logits after one more frame.

        Raises:
            UserError: the network looks ahead; names the field of its configuration and a value that does not.
        """
        if (problem := self.network.config.looks_ahead) is not None:
            raise UserError("mismatch", f"{problem} in MambaSplatConfig: such a model reads whole clips alone")
        subsets = self._subsets(seen.gaussians)
        count, mask = subsets.shape[0], jnp.broadcast_to(valid, subsets.shape[1:2])
        used = jax.tree.map(lambda leaf: leaf[:count], state)
        logits, following = jax.vmap(lambda columns, state: self.network.step(columns, mask, state))(subsets, used)
        # Ensembles that the frame has no tokens for stay as they were.
        state = jax.tree.map(lambda new, old: jnp.concatenate([new, old[count:]]), following, state)
        return calibrated_answer(logits, self.card.temperature), state

    def clip(self, seen: Evidence, valid: Bool[Array, "time"]) -> Float[Array, "time label"]:
        """Logits after each frame; a model that looks ahead sees the whole clip's scale in each of them."""

        def read(columns: Float[Array, "time token 14"]) -> Float[Array, "time label"]:
            return self.network.prefixes(columns, jnp.broadcast_to(valid[:, None], columns.shape[:2]))

        return calibrated_answer(jax.vmap(read)(self._subsets(seen.gaussians)), self.card.temperature)

    def _subsets(self, gaussians: Gaussians) -> Float[Array, "ensemble *time token 14"]:
        return token_ensembles(self.prepare(gaussians.columns()), self.card.tokens, self.card.token_ensembles)
