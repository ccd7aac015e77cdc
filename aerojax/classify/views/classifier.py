"""The views network behind the door of stage 3: what it takes from the evidence, and its card."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Key

from aerojax.classify.card import Card
from aerojax.classify.ensembles import calibrated_answer
from aerojax.classify.views.model import ViewsNetwork, ViewsState, outline_mean
from aerojax.core.errors import UserError
from aerojax.core.types import Crops, Evidence, pytree_dataclass, static_field


@pytree_dataclass
class ViewsClassifier:
    """A `Trainable` of `aerojax.classify.base` that reads crops alone; see `ViewsNetwork` for its symmetries."""

    network: ViewsNetwork
    card: Card = static_field()

    @property
    def reads_crops(self) -> bool:
        """Always."""
        return True

    @property
    def causal(self) -> bool:
        """Always."""
        return True

    def prepare(self, columns: Float[Array, "*batch token 14"]) -> Float[Array, "*batch token 14"]:
        """Nothing: Gaussians are not read."""
        return columns

    def logits(
        self,
        columns: Float[Array, "time token 14"],
        mask: Bool[Array, "time token"],
        crops: Crops | None = None,
    ) -> Float[Array, "label"]:
        """The network's logits of one clip; of the Gaussians it is read in which frames there are any."""
        return self.network(*counted(crops, mask.any(axis=1)))

    def training_logits(
        self,
        columns: Float[Array, "time token 14"],
        mask: Bool[Array, "time token"],
        crops: Crops | None,
        *,
        key: Key[Array, ""],
    ) -> Float[Array, "head label"]:
        """The same of its only head, with dropout."""
        return self.network(*counted(crops, mask.any(axis=1)), key=key)[None]

    def initial(self) -> ViewsState:
        """The network's state before the first frame."""
        return self.network.initial_state()

    def step(
        self, seen: Evidence, valid: Bool[Array, ""], state: ViewsState
    ) -> tuple[Float[Array, "label"], ViewsState]:
        """Logits after one more frame.

        Raises:
            UserError: the evidence has no crops, or more than the state has room for.
        """
        logits, _, state = self.step_features(seen, valid, state)
        return logits, state

    def step_features(
        self, seen: Evidence, valid: Bool[Array, ""], state: ViewsState
    ) -> tuple[Float[Array, "label"], Float[Array, "row feature"], ViewsState]:
        """The same with two rows of features of the only network.

        The first is the mean of what the layers over time gave. The head reads the frames' deviation, too, but of it
        the training clips have a long tail, beside which nothing looks strange. The second is the mean of the
        outlines' closed-form descriptors, with zeros behind it: layers that were trained to tell classes apart forget
        what does not, such as how round a thing is.

        Raises:
            UserError: as `step`.
        """
        read, state = self.network.advance(*counted(seen.crops, valid), state)
        logits = calibrated_answer(self.network.head(read)[None], self.card.temperature)
        return logits, self._rows(read, outline_mean(state.outlines)), state

    def clip(self, seen: Evidence, valid: Bool[Array, "time"]) -> Float[Array, "time label"]:
        """Logits after each frame.

        Raises:
            UserError: the evidence has no crops.
        """
        return self.clip_features(seen, valid)[0]

    def clip_features(
        self, seen: Evidence, valid: Bool[Array, "time"]
    ) -> tuple[Float[Array, "time label"], Float[Array, "time row feature"]]:
        """The same with features, as `step_features` has them.

        Raises:
            UserError: the evidence has no crops.
        """
        given = counted(seen.crops, valid)
        read = self.network.readouts(*given)[0]
        logits = calibrated_answer(jax.vmap(self.network.head)(read)[None], self.card.temperature)
        return logits, jax.vmap(self._rows)(read, self.network.outline_means(*given))

    @property
    def feature_weights(self) -> tuple[float, ...]:
        """Two parts what was learned and one part what is known of outlines, chosen on validation clips."""
        return 2 / 3, 1 / 3

    def _rows(self, read: Float[Array, "twice_width"], outlines: Float[Array, "descriptor"]) -> Float[Array, "2 width"]:
        encoded = read[: self.network.config.d_model]
        kept = outlines[: len(encoded)]
        return jnp.stack([encoded, jnp.pad(kept, (0, len(encoded) - len(kept)))])


def counted(
    crops: Crops | None, present: Bool[Array, "*time"]
) -> tuple[Float[Array, "*time view size size 4"], Bool[Array, "*time view"]]:
    """Images, and which of them count: those that are valid in frames that are present.

    Raises:
        UserError: there are no crops.
    """
    if crops is None:
        raise UserError("missing", "a classifier of views is given no crops", "give it Evidence with crops")
    return crops.rgba, crops.valid & jnp.expand_dims(present, -1)
