"""The 2D baselines on crops behind the door of stage 3: every crop a label, and a vote over cameras and frames."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Key

from aerojax.classify.baselines.clouds import cycled
from aerojax.classify.card import Card
from aerojax.classify.ensembles import calibrated_answer
from aerojax.classify.images.crop_network import CropNetwork
from aerojax.classify.images.votes import Ballot, cast, empty_ballot
from aerojax.classify.views.classifier import counted
from aerojax.classify.views.config import MOST_VIEWS
from aerojax.classify.views.polar import LEAST_AREA
from aerojax.core.errors import UserError
from aerojax.core.types import Crops, Evidence, pytree_dataclass, static_field


@pytree_dataclass
class CropVotesState:
    """What a stream remembers.

    recent: crops of the frames before, the newest last; black where a camera had none.
    ballot: labels so far.
    """

    recent: Float[Array, "before view pixels pixels 4"]
    ballot: Ballot


@pytree_dataclass
class CropVotes:
    """A `Trainable` of `aerojax.classify.base` whose network labels crops; in training each has its clip's label.

    The answer is the majority of the labels over all cameras and frames so far, a tie goes to the more confident class
    (thesis §5.7.1). The order of cameras says nothing, that of the frames only within the network's window.
    """

    network: CropNetwork
    card: Card = static_field()

    @property
    def reads_crops(self) -> bool:
        """Always."""
        return True

    @property
    def causal(self) -> bool:
        """Always: a window ends with its frame."""
        return True

    def prepare(self, columns: Float[Array, "*batch token 14"]) -> Float[Array, "*batch token 14"]:
        """Nothing: Gaussians are not read."""
        return columns

    def logits(
        self, columns: Float[Array, "time token 14"], mask: Bool[Array, "time token"], crops: Crops | None = None
    ) -> Float[Array, "label"]:
        """Of the vote; of the Gaussians it is read in which frames there are any."""
        return self._votes(crops, mask.any(axis=1))[-1]

    def training_logits(
        self,
        columns: Float[Array, "time token 14"],
        mask: Bool[Array, "time token"],
        crops: Crops | None,
        *,
        key: Key[Array, ""],
    ) -> Float[Array, "head label"]:
        """Logits with dropout of some crops that count, drawn anew each time; the same ones again if there are few."""
        draw, drops = jax.random.split(key)
        present = mask.any(axis=1)
        images, counts = self._look(crops, present)
        order = jax.random.permutation(draw, counts.size)
        chosen = order[cycled(counts.reshape(-1)[order])][jnp.arange(self.network.sample) % counts.size]
        frame, view = jnp.divmod(chosen, counts.shape[1])
        index, there = windows_of(present, self.network.window)
        picked = jnp.where(there[frame][..., None, None, None], images[index[frame], view[:, None]], 0.0)
        return jax.vmap(lambda window, each: self.network(window, key=each))(
            picked, jax.random.split(drops, self.network.sample)
        )

    def initial(self) -> CropVotesState:
        """No frame yet."""
        kind, size = self.network.head.weight[...].dtype, self.network.pixels
        recent = jnp.zeros((self.network.window - 1, MOST_VIEWS, size, size, 4), kind)
        return CropVotesState(recent, empty_ballot(len(self.card.classes), kind))

    def step(
        self, seen: Evidence, valid: Bool[Array, ""], state: CropVotesState
    ) -> tuple[Float[Array, "label"], CropVotesState]:
        """Logits after one more frame.

        Raises:
            UserError: the evidence has no crops, or more than the state has room for.
        """
        now, counts = jax.tree.map(lambda leaf: leaf[0], self._look(_in_front(seen.crops), valid[None]))
        if (views := counts.shape[0]) > MOST_VIEWS:
            raise UserError("mismatch", f"{views} cameras, but a stream remembers {MOST_VIEWS}", "leave some out")
        window = jnp.concatenate([state.recent[:, :views], now[None]])
        ballot = state.ballot + cast(jax.vmap(self.network, in_axes=1)(window), counts)
        recent = jnp.concatenate([state.recent, jnp.pad(now, ((0, MOST_VIEWS - views), *((0, 0),) * 3))[None]])[1:]
        state = CropVotesState(jnp.where(valid, recent, state.recent), ballot)
        return calibrated_answer(ballot.logits()[None], self.card.temperature), state

    def clip(self, seen: Evidence, valid: Bool[Array, "time"]) -> Float[Array, "time label"]:
        """Logits after each frame.

        Raises:
            UserError: the evidence has no crops.
        """
        return calibrated_answer(self._votes(seen.crops, valid)[None], self.card.temperature)

    def _votes(self, crops: Crops | None, present: Bool[Array, "time"]) -> Float[Array, "time label"]:
        images, counts = self._look(crops, present)
        index, there = windows_of(present, self.network.window)
        windows = jnp.where(there[..., None, None, None, None], images[index], 0.0)
        labels = jax.vmap(jax.vmap(self.network, in_axes=1))(windows)
        return jax.tree.map(lambda each: jnp.cumsum(each, axis=0), cast(labels, counts)).logits()

    def _look(
        self, crops: Crops | None, present: Bool[Array, "time"]
    ) -> tuple[Float[Array, "time view pixels pixels 4"], Bool[Array, "time view"]]:
        """Crops of the network's size, black where they do not count, and which ones count: those that show anything.

        Raises:
            UserError: there are no crops.
        """
        images, counts = counted(crops, present)
        images = jnp.where(counts[..., None, None, None], images, jnp.zeros((), images.dtype))
        counts = counts & (images[..., 3].sum(axis=(-2, -1)) > LEAST_AREA)
        size = self.network.pixels
        if images.shape[2:4] != (size, size):
            images = jax.image.resize(images, (*images.shape[:2], size, size, 4), "linear")
        return images, counts


def windows_of(present: Bool[Array, "time"], length: int) -> tuple[Array, Bool[Array, "time {length}"]]:
    """Of each frame the indices of the present frames up to it, the newest last, and which of them there are.

    Rows of frames that are not present mean nothing.
    """
    order = jnp.argsort(~present, stable=True)
    place = jnp.cumsum(present)[:, None] - jnp.arange(length, 0, -1)[None]
    return order[jnp.maximum(place, 0)], place >= 0


def _in_front(crops: Crops | None) -> Crops | None:
    """One frame as a clip of one."""
    return None if crops is None else jax.tree.map(lambda leaf: leaf[None], crops)
