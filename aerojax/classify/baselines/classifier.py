"""The baselines behind the door of stage 3: networks that read single frames, and networks that read whole clips."""

from __future__ import annotations

from typing import Any, Protocol

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, Key

from aerojax.classify.baselines.clouds import clouds, cycled
from aerojax.classify.baselines.tubes import anchor_frames, valid_anchor_frames
from aerojax.classify.card import Card
from aerojax.classify.ensembles import calibrated_answer, token_ensembles
from aerojax.core.errors import UserError
from aerojax.core.types import Crops, Evidence, Gaussians, pytree_dataclass, static_field


@pytree_dataclass
class Votes:
    """What has been said of the frames so far: sums of class probabilities, one an ensemble, and how many frames."""

    probabilities: Float[Array, "ensemble label"]
    count: Float[Array, ""]


@pytree_dataclass
class FrameClassifier:
    """A `Trainable` whose network classifies single frames; a clip's answer is the mean of their probabilities.

    The published VN-PointNet and VN-DGCNN classify static clouds, and know nothing of time. In training every frame is
    an example of its own, with its clip's label.
    """

    network: Any
    card: Card = static_field()

    @property
    def reads_crops(self) -> bool:
        """Never."""
        return False

    @property
    def causal(self) -> bool:
        """Always: frames are read alone."""
        return True

    def prepare(self, columns: Float[Array, "*batch token 14"]) -> Float[Array, "*batch token 14"]:
        """Nothing: frames are normalised where they are read."""
        return columns

    def logits(
        self, columns: Float[Array, "time token 14"], mask: Bool[Array, "time token"], crops: Crops | None = None
    ) -> Float[Array, "label"]:
        """Logarithm of the mean probability over the frames that have tokens."""
        return _vote(self._frames(columns, mask), mask.any(axis=1))[-1]

    def training_logits(
        self,
        columns: Float[Array, "time token 14"],
        mask: Bool[Array, "time token"],
        crops: Crops | None,
        *,
        key: Key[Array, ""],
    ) -> Float[Array, "head label"]:
        """Logits of every frame with dropout; in the place of a frame without tokens another one stands again.

        Batch norms take the batch's statistics, for which the call has to stand in a `jax.vmap` over `CLIP_AXIS`.
        """
        points, present = clouds(columns, mask, self.card.scale_normalisation), mask.any(axis=1)
        return self.network(points, present.astype(points.dtype), key=key)[cycled(present)]

    def initial(self) -> Votes:
        """No frame yet."""
        kind = jax.tree.leaves(self.network)[0].dtype
        return Votes(jnp.zeros((self.card.token_ensembles, len(self.card.classes)), kind), jnp.zeros((), kind))

    def step(self, seen: Evidence, valid: Bool[Array, ""], state: Votes) -> tuple[Float[Array, "label"], Votes]:
        """Logits after one more frame."""
        subsets = self._subsets(seen.gaussians)
        mask = jnp.broadcast_to(valid, (1, subsets.shape[1]))
        logits = jax.vmap(lambda columns: self._frames(columns[None], mask)[0])(subsets)
        weight = valid.astype(logits.dtype)
        added = jnp.pad(jax.nn.softmax(logits), ((0, self.card.token_ensembles - len(logits)), (0, 0)))
        state = Votes(state.probabilities + weight * added, state.count + weight)
        mean = _log_mean(state.probabilities[: len(logits)], state.count)
        return calibrated_answer(mean, self.card.temperature), state

    def clip(self, seen: Evidence, valid: Bool[Array, "time"]) -> Float[Array, "time label"]:
        """Logits after each frame."""

        def read(columns: Float[Array, "time token 14"]) -> Float[Array, "time label"]:
            return _vote(self._frames(columns, jnp.broadcast_to(valid[:, None], columns.shape[:2])), valid)

        return calibrated_answer(jax.vmap(read)(self._subsets(seen.gaussians)), self.card.temperature)

    def _frames(self, columns: Array, mask: Array) -> Float[Array, "time label"]:
        """The network's logits of each frame; one after the other, because neighbours need much memory."""
        points = clouds(columns, mask, self.card.scale_normalisation)
        return jax.lax.map(lambda frame: self.network(frame[None])[0], points)

    def _subsets(self, gaussians: Gaussians) -> Float[Array, "ensemble *time token 14"]:
        return token_ensembles(gaussians.columns(), self.card.tokens, self.card.token_ensembles)


def _vote(logits: Float[Array, "time label"], present: Bool[Array, "time"]) -> Float[Array, "time label"]:
    """Logarithm of the mean probability of the present frames up to each."""
    weight = present.astype(logits.dtype)[:, None]
    sums = jnp.cumsum(jax.nn.softmax(logits) * weight, axis=0)
    return _log_mean(sums, jnp.cumsum(weight, axis=0))


def _log_mean(sums: Array, count: Array) -> Array:
    """Logarithm of sums over a count; of equal probabilities where nothing was counted."""
    mean = jnp.where(count > 0, sums / jnp.maximum(count, 1.0), 1.0 / sums.shape[-1])
    return jnp.log(jnp.maximum(mean, 1e-30))


class ClipNetwork(Protocol):
    """What `ClipClassifier` asks of a network; see `P4Transformer`."""

    def __call__(
        self, points: Array, count: Int[Array, ""], *, key: Key[Array, ""] | None = None
    ) -> Float[Array, "label"]:
        """Logits of a clip."""
        ...

    def embedded(
        self, points: Array, count: Int[Array, ""], *, key: Key[Array, ""] | None = None
    ) -> tuple[Array, Array]:
        """Anchors and features of a clip's tubes."""
        ...

    def answer(
        self, anchors: Array, features: Array, valid: Array, *, key: Key[Array, ""] | None = None
    ) -> Float[Array, "label"]:
        """Logits from them."""
        ...


@pytree_dataclass
class ClipClassifier:
    """A `Trainable` whose network reads the tubes of whole clips."""

    network: Any
    card: Card = static_field()

    @property
    def reads_crops(self) -> bool:
        """Never."""
        return False

    @property
    def causal(self) -> bool:
        """Never: a tube holds points of a later frame."""
        return False

    def prepare(self, columns: Float[Array, "*batch token 14"]) -> Float[Array, "*batch token 14"]:
        """Nothing: clips are normalised where they are read."""
        return columns

    def logits(
        self, columns: Float[Array, "time token 14"], mask: Bool[Array, "time token"], crops: Crops | None = None
    ) -> Float[Array, "label"]:
        """The network's logits of the frames that have tokens."""
        return self.network(*self._read(columns, mask))

    def training_logits(
        self,
        columns: Float[Array, "time token 14"],
        mask: Bool[Array, "time token"],
        crops: Crops | None,
        *,
        key: Key[Array, ""],
    ) -> Float[Array, "head label"]:
        """The same of its only head, with dropout.

        Mamba4D's batch norms take the batch's statistics: the call has to stand in a `jax.vmap` over `CLIP_AXIS`.
        """
        return self.network(*self._read(columns, mask), key=key)[None]

    def initial(self) -> None:
        """Nothing: there are no steps."""

    def step(self, seen: Evidence, valid: Bool[Array, ""], state: None) -> tuple[Float[Array, "label"], None]:
        """Refuse.

        Raises:
            UserError: always.
        """
        problem = f"the classifier {self.card.name!r} reads tubes of three frames and so whole clips alone"
        raise UserError("mismatch", problem, "classify a recorded capture, or take a classifier that reads frames")

    def clip(self, seen: Evidence, valid: Bool[Array, "time"]) -> Float[Array, "time label"]:
        """Logits after each frame: the network on that prefix, in the normalisation of the whole clip.

        Tubes are described once. An odd frame is no anchor's neighbour yet, so its row repeats the one before it.
        """
        subsets = token_ensembles(seen.gaussians.columns(), self.card.tokens, self.card.token_ensembles)

        def read(columns: Float[Array, "time token 14"]) -> Float[Array, "time label"]:
            return self._prefixes(*self._read(columns, jnp.broadcast_to(valid[:, None], columns.shape[:2])), valid)

        return calibrated_answer(jax.vmap(read)(subsets), self.card.temperature)

    def _prefixes(
        self, points: Float[Array, "time token 3"], count: Int[Array, ""], valid: Bool[Array, "time"]
    ) -> Float[Array, "time label"]:
        network: ClipNetwork = self.network
        frames = points.shape[0]
        found = network.embedded(points, count)
        number = jnp.arange(anchor_frames(frames))
        rows = jax.lax.map(lambda last: network.answer(*found, number <= last), number)
        so_far = jnp.cumsum(valid)
        alone = network(points[:1], jnp.ones((), jnp.int32))
        before = jnp.where(so_far[:-1, None] > 1, rows[jnp.maximum(so_far[:-1] // 2, 1) - 1], alone[None])
        before = jnp.where(so_far[:-1, None] > 0, before, 0.0)
        # Apart from the rows above, so that whoever wants the last row alone does not pay for them.
        last = network.answer(*found, valid_anchor_frames(count, frames))
        return jnp.concatenate([before, jnp.where(count > 0, last, 0.0)[None]])

    def _read(self, columns: Array, mask: Array) -> tuple[Float[Array, "time token 3"], Int[Array, ""]]:
        """Points with the frames that are present in front, and how many those are."""
        present = mask.any(axis=1)
        points = clouds(columns, mask, self.card.scale_normalisation)
        return points[jnp.argsort(~present, stable=True)], present.sum()
