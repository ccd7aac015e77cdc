"""The door of stage 3: a classifier takes what was seen in one frame after the other and gives logits after each."""

from __future__ import annotations

import dataclasses
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, TypeVar, runtime_checkable

from jaxtyping import Array, Bool, Float, Key

from aerojax.classify.card import Card, Settings, TrainRotation, flat_settings
from aerojax.core.config import require_at_least, to_mapping
from aerojax.core.errors import UserError
from aerojax.core.types import CLASSES, Crops, Evidence

CLIP_AXIS = "clip"
"""Name of the axis along which training maps the clips of a batch: batch norms take their statistics over it."""
State = Any
"""A pytree of a size that does not grow, which only the classifier that made it understands."""


@runtime_checkable
class Classifier(Protocol):
    """A trained classifier: a pytree whose data are its parameters and whose structure holds its card.

    All logits are logarithms of class probabilities: those of `card.token_ensembles` disjoint subsets of the tokens,
    averaged. Gaussians are in metres, world frame, in random order within a frame.
    """

    @property
    def reads_crops(self) -> bool:
        """Whether the answer depends on the crops."""
        ...

    @property
    def card(self) -> Card:
        """What the classifier was trained with and how it is read."""
        ...

    @property
    def causal(self) -> bool:
        """Whether nothing looks ahead, so that frames can be classified as they come."""
        ...

    def initial(self) -> State:
        """The state before the first frame."""
        ...

    def step(self, seen: Evidence, valid: Bool[Array, ""], state: State) -> tuple[Float[Array, "label"], State]:
        """Logits after one more frame, in time and memory that do not grow.

        Args:
            seen: of one frame; as many Gaussians and crops in every frame of a stream.
            valid: False leaves the state, and so the logits, as they were.
            state: from `initial` or the last step.

        Raises:
            UserError: the classifier is not causal; the message names why.
        """
        ...

    def clip(self, seen: Evidence, valid: Bool[Array, "time"]) -> Float[Array, "time label"]:
        """Logits after each frame of a clip; the last row is the answer.

        Equal to the fold of `step` for causal classifiers. Time and memory grow linearly with the frames.

        Args:
            seen: leading axis time.
            valid: frames that count.
        """
        ...


@runtime_checkable
class Embedding(Classifier, Protocol):
    """A classifier that also tells what its answer was read from, by which it is judged whether it knows the like.

    Features are rows of one length, whatever the clip's: of an ensemble those of each network. They are as invariant as
    the answer is.
    """

    @property
    def feature_weights(self) -> tuple[float, ...]:
        """How much each row says of whether an object is known; they sum to 1."""
        ...

    def step_features(
        self, seen: Evidence, valid: Bool[Array, ""], state: State
    ) -> tuple[Float[Array, "label"], Float[Array, "row feature"], State]:
        """As `step`, with the features between logits and state."""
        ...

    def clip_features(
        self, seen: Evidence, valid: Bool[Array, "time"]
    ) -> tuple[Float[Array, "time label"], Float[Array, "time row feature"]]:
        """As `clip`, with the features after each frame."""
        ...


@runtime_checkable
class Trainable(Classifier, Protocol):
    """A classifier as training sees it: `jax.grad` with respect to it gives a classifier of gradients."""

    @property
    def network(self) -> Any:
        """The pytree that holds every parameter."""
        ...

    def prepare(self, columns: Float[Array, "*batch token 14"]) -> Float[Array, "*batch token 14"]:
        """What is done to a whole frame before a subset of its tokens is drawn; often nothing."""
        ...

    def logits(
        self,
        columns: Float[Array, "time token 14"],
        mask: Bool[Array, "time token"],
        crops: Crops | None = None,
    ) -> Float[Array, "label"]:
        """The network's own logits of one clip of prepared tokens, without ensembles.

        Args:
            columns: attributes as `Gaussians.columns` orders them, after `prepare`.
            mask: valid tokens; a frame without any counts for nothing.
            crops: leading axis time.
        """
        ...

    def training_logits(
        self,
        columns: Float[Array, "time token 14"],
        mask: Bool[Array, "time token"],
        crops: Crops | None,
        *,
        key: Key[Array, ""],
    ) -> Float[Array, "head label"]:
        """Logits with dropout of every head that is to learn, the answer's first; arguments as in `logits`."""
        ...


@dataclass(frozen=True)
class ClassifierConfig(ABC):
    """Configuration of a member, chosen by its name: `classify=mambasplat`."""

    members: ClassVar[str] = "aerojax.classify.members"

    @abstractmethod
    def build(self, card: Card, *, key: Key[Array, ""]) -> Trainable:
        """A classifier with random weights and the given card."""

    @property
    @abstractmethod
    def label(self) -> str:
        """A short name for people."""

    @property
    @abstractmethod
    def rotation_invariant(self) -> bool:
        """Whether no rotation of the world changes the logits, whatever the weights."""


def require_counts(config: ClassifierConfig, *names: str, least: int = 1) -> None:
    """Refuse fields of a configuration that are too small.

    Raises:
        UserError: names the first such field, its value and the least that works.
    """
    require_at_least(config, *names, least=least)


def require_rates(config: ClassifierConfig, *names: str) -> None:
    """Refuse fields of a configuration that are no rates of dropout.

    Raises:
        UserError: names the first such field, its value and the values that work.
    """
    _require(config, names, lambda value: 0 <= value < 1, "a rate lies in [0, 1)")


def _require(config: ClassifierConfig, names: Sequence[str], fits: Callable[[float], bool], remedy: str) -> None:
    for name in names:
        if not fits(getattr(config, name)):
            problem = f"{name} is {getattr(config, name)} in {type(config).__name__}"
            raise UserError("out-of-range", problem, remedy)


def untrained_card(
    config: ClassifierConfig,
    *,
    tokens: int,
    frames: int,
    token_ensembles: int = 4,
    rotation: TrainRotation = "none",
    settings: Settings = (),
) -> Card:
    """The card that the training of a classifier begins with; see `Card` for the arguments."""
    values = dict(flat_settings(to_mapping(config)))
    return Card(
        name=config.label,
        member=str(values.pop("name")),
        config=tuple(sorted(values.items())),
        classes=CLASSES,
        tokens=tokens,
        frames=frames,
        token_ensembles=token_ensembles,
        scale_normalisation=str(values.get("scale_normalisation", "none")),
        rotation_invariant=config.rotation_invariant,
        rotation=rotation,
        settings=settings,
    )


def untrained(config: ClassifierConfig, *, key: Key[Array, ""], **card: Any) -> Trainable:
    """A classifier with random weights and the card of `untrained_card`, which `card` are the arguments of."""
    return config.build(untrained_card(config, **card), key=key)


_C = TypeVar("_C", bound=Classifier)


def with_card(classifier: _C, **changes: Any) -> _C:
    """The same classifier with other values in fields of its card, such as `token_ensembles`."""
    return dataclasses.replace(classifier, card=dataclasses.replace(classifier.card, **changes))  # pyrefly: ignore
