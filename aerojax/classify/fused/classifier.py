"""The fused network behind the door of stage 3: its two kinds of evidence, token ensembles, streams."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Key

from aerojax.classify.card import Card
from aerojax.classify.ensembles import calibrated_answer, token_ensembles
from aerojax.classify.fused.model import FusedNetwork, Reading
from aerojax.classify.mambasplat.model import StreamState
from aerojax.classify.views.model import ViewsState
from aerojax.core.errors import UserError
from aerojax.core.types import Crops, Evidence, pytree_dataclass, static_field


@pytree_dataclass
class FusedState:
    """What both paths remember: the Gaussian path once for each ensemble of tokens."""

    gaussians: StreamState
    views: ViewsState


@pytree_dataclass
class FusedClassifier:
    """A `Trainable` of `aerojax.classify.base`; evidence of either kind may be missing.

    Without crops it is the Gaussian path alone, and the answer exactly invariant to rotations of the Gaussians. Without
    Gaussians, or where all are transparent, it is the views path alone. A frame counts for each path by itself.
    """

    network: FusedNetwork
    card: Card = static_field()

    @property
    def reads_crops(self) -> bool:
        """Always, if there are any."""
        return True

    @property
    def causal(self) -> bool:
        """Whether the Gaussian path is."""
        return self.network.config.gaussians.looks_ahead is None

    def prepare(self, columns: Float[Array, "*batch token 14"]) -> Float[Array, "*batch token 14"]:
        """Nothing."""
        return columns

    def logits(
        self,
        columns: Float[Array, "time token 14"],
        mask: Bool[Array, "time token"],
        crops: Crops | None = None,
    ) -> Float[Array, "label"]:
        """The network's logits of one clip; frames without valid tokens may have crops that count."""
        return self._heads(columns, mask, crops, None)[0]

    def training_logits(
        self,
        columns: Float[Array, "time token 14"],
        mask: Bool[Array, "time token"],
        crops: Crops | None,
        *,
        key: Key[Array, ""],
    ) -> Float[Array, "head label"]:
        """Logits of the answer, which may miss a path, and of each path alone; all with dropout."""
        return self._heads(columns, mask, crops, key)

    def _heads(
        self,
        columns: Float[Array, "time token 14"],
        mask: Bool[Array, "time token"],
        crops: Crops | None,
        key: Key[Array, ""] | None,
    ) -> Float[Array, "head label"]:
        first, second, third = (None,) * 3 if key is None else jax.random.split(key, 3)
        gaussians = self.network.read_gaussians(columns, mask, key=first)
        views = self.network.read_views(*_images(crops, jnp.ones(columns.shape[0], bool)), key=second)
        gaussians, views = jax.tree.map(lambda leaf: leaf[-1], (gaussians, views))
        return self.network.heads(gaussians, views, key=third)

    def initial(self) -> FusedState:
        """The state before the first frame."""
        state = self.network.gaussians.initial_state()
        stacked = jax.tree.map(lambda leaf: jnp.stack([leaf] * self.card.token_ensembles), state)
        return FusedState(stacked, self.network.views.initial_state())

    def step(
        self, seen: Evidence, valid: Bool[Array, ""], state: FusedState
    ) -> tuple[Float[Array, "label"], FusedState]:
        """Logits after one more frame.

        Raises:
            UserError: the Gaussian path looks ahead; names the field of its configuration and a value that does not.
        """
        if (problem := self.network.config.gaussians.looks_ahead) is not None:
            raise UserError("mismatch", f"{problem} in MambaSplatConfig: such a model reads whole clips alone")
        views, views_state = self._step_views(seen.crops, valid, state.views)
        gaussians, gaussians_state = self._step_gaussians(seen, valid, state.gaussians)
        logits = jax.vmap(lambda one: self.network.answer(one, views))(gaussians)
        return calibrated_answer(logits, self.card.temperature), FusedState(gaussians_state, views_state)

    def _step_views(self, crops: Crops | None, valid: Bool[Array, ""], state: ViewsState) -> tuple[Reading, ViewsState]:
        views = self.network.views
        rgba, counts = _images(crops, valid)
        if rgba is None:
            # A frame without a view leaves the state as it was, and gives what was read before.
            rgba, counts = jnp.zeros((1, 2, 2, 4), state.sums.dtype), jnp.zeros(1, bool)
        readout, state = views.advance(rgba, counts, state)
        return Reading(readout, state.count > 0), state

    def _step_gaussians(
        self, seen: Evidence, valid: Bool[Array, ""], state: StreamState
    ) -> tuple[Reading, StreamState]:
        network, subsets = self.network.gaussians, self._subsets(seen)
        count = subsets.shape[0]
        used = jax.tree.map(lambda leaf: leaf[:count], state)
        mask = _visible(subsets) & valid
        readout, following = jax.vmap(network.advance)(subsets, mask, used)
        # Ensembles that the frame has no tokens for stay as they were.
        state = jax.tree.map(lambda new, old: jnp.concatenate([new, old[count:]]), following, state)
        return Reading(readout, following.count > 0), state

    def clip(self, seen: Evidence, valid: Bool[Array, "time"]) -> Float[Array, "time label"]:
        """Logits after each frame."""
        views = self.network.read_views(*_images(seen.crops, valid))

        def read(columns: Float[Array, "time token 14"]) -> Float[Array, "time label"]:
            gaussians = self.network.read_gaussians(columns, _visible(columns) & valid[:, None])
            return jax.vmap(self.network.answer)(gaussians, views)

        return calibrated_answer(jax.vmap(read)(self._subsets(seen)), self.card.temperature)

    def _subsets(self, seen: Evidence) -> Float[Array, "ensemble *time token 14"]:
        columns = seen.gaussians.columns()
        if columns.shape[-2] == 0:
            # One transparent Gaussian stands for none.
            columns = jnp.zeros((*columns.shape[:-2], 1, 14), columns.dtype)
        return token_ensembles(columns, self.card.tokens, self.card.token_ensembles)


def _visible(columns: Float[Array, "*batch token 14"]) -> Bool[Array, "*batch token"]:
    return columns[..., 10] > 0


def _images(
    crops: Crops | None, valid: Bool[Array, "*time"]
) -> tuple[Float[Array, "*time view size size 4"] | None, Bool[Array, "*time view"]]:
    """Images, if there are any, and which of them count."""
    if crops is None:
        return None, jnp.zeros((*valid.shape, 1), bool)
    return crops.rgba, crops.valid & jnp.expand_dims(valid, -1)
