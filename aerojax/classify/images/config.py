"""What the 2D baselines that read crops are made of."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, ClassVar, Literal

from jaxtyping import Array, Key

from aerojax.classify.base import ClassifierConfig, require_counts, require_rates
from aerojax.classify.card import Card
from aerojax.core.errors import UserError
from aerojax.core.types import CLASSES

if TYPE_CHECKING:
    from aerojax.classify.images.classifier import CropVotes

REDUCTION = 8
"""The network halves its image three times."""
FUSED_FRAMES = 5
"""Consecutive frames that FBOD-SV reads as one image (thesis Table 6.20)."""


@dataclasses.dataclass(frozen=True)
class CropConfig(ClassifierConfig):
    """A network that labels crops, whose labels are counted; the named members below say of how many frames."""

    window: ClassVar[int] = 1
    pixels: int = 32
    width: int = 32
    sample: int = 24
    dropout: float = 0.2
    classes: int = len(CLASSES)

    def __post_init__(self) -> None:
        """Refuse what cannot be built.

        Raises:
            UserError: names the field and a value that works.
        """
        require_counts(self, "width", "sample", "classes")
        require_rates(self, "dropout")
        if self.pixels < REDUCTION or self.pixels % REDUCTION:
            problem = f"pixels is {self.pixels} in {type(self).__name__}"
            raise UserError("out-of-range", problem, f"it must be a multiple of {REDUCTION}")

    def build(self, card: Card, *, key: Key[Array, ""]) -> CropVotes:
        """A classifier with random weights and the given card."""
        # The network is made of this configuration, so its module cannot be imported before this one is.
        from aerojax.classify.images.classifier import CropVotes
        from aerojax.classify.images.crop_network import CropNetwork

        return CropVotes(CropNetwork(self, key=key), card)

    @property
    def rotation_invariant(self) -> bool:
        """True: no image changes when the world and its cameras turn together, so no answer does."""
        return True


@dataclasses.dataclass(frozen=True)
class B4LiteConfig(CropConfig):
    """B4-lite: a small network labels every crop by itself, and the labels are counted (thesis §5.7.2, in small).

    pixels: side of the crops as the network reads them. width: channels of its first layer; the others have two and
        four times as many. sample: crops of a clip that a training step reads. dropout: rate before the answer.
    classes: number of answers.
    """

    name: Literal["b4_lite"] = "b4_lite"

    @property
    def label(self) -> str:
        """What it is."""
        return "B4-lite, crops one by one"


@dataclasses.dataclass(frozen=True)
class B3LiteConfig(CropConfig):
    """B3-lite on crops: as B4-lite, but a camera's last five crops are the channels of one image.

    The published B3 finds the object in whole images; `train_detector detector.frames=5` is that.

    pixels: side of the crops as the network reads them. width: channels of its first layer; the others have two and
        four times as many. sample: crops of a clip that a training step reads. dropout: rate before the answer.
    classes: number of answers.
    """

    window: ClassVar[int] = FUSED_FRAMES
    name: Literal["b3_lite"] = "b3_lite"

    @property
    def label(self) -> str:
        """What it is."""
        return f"B3-lite on crops, {self.window} frames fused"
