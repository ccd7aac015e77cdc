"""What a views model is made of: one frozen dataclass."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Literal

from jaxtyping import Array, Key

from aerojax.classify.base import ClassifierConfig, require_counts, require_rates
from aerojax.classify.card import Card
from aerojax.classify.mambasplat.config import MambaSplatConfig
from aerojax.core.errors import UserError
from aerojax.core.types import CLASSES

if TYPE_CHECKING:
    from aerojax.classify.views.classifier import ViewsClassifier

MOST_VIEWS = 16
"""Cameras that a stream can remember; the state has a slot for each."""


@dataclasses.dataclass(frozen=True)
class ViewsConfig(ClassifierConfig):
    """Size and input of a views model; rates are probabilities.

    colour: whether the crops' colours are read beside their coverage.
    radii, angles, reach: of the polar grid; it ends at `reach` root mean square radii of the silhouette.
    harmonics: highest angular frequency of the closed-form descriptors.
    width: channels of the angular convolutions. taps: angles that each reads.
    pooled_harmonics: angular frequencies of each channel whose magnitude is read, besides its mean and maximum.
    hidden: of the layer that reads the closed-form descriptors. view_width: of one view's descriptor.
    d_model, layers, d_state, d_conv, expand: of the Mamba layers over time.
    view_dropout: rate at which whole views are left out. dropout: of the Mamba layers' outputs. drop_path: of whole
        layers, at the last one; earlier ones have less. head_dropout: before the answer.
    classes: number of answers.
    """

    name: Literal["views"] = "views"
    colour: bool = False
    radii: int = 16
    angles: int = 32
    reach: float = 2.75
    harmonics: int = 8
    width: int = 64
    taps: int = 3
    pooled_harmonics: int = 4
    hidden: int = 96
    view_width: int = 96
    d_model: int = 128
    layers: int = 2
    d_state: int = 16
    d_conv: int = 4
    expand: int = 2
    view_dropout: float = 0.1
    dropout: float = 0.05
    drop_path: float = 0.1
    head_dropout: float = 0.1
    classes: int = len(CLASSES)

    def __post_init__(self) -> None:
        """Refuse what cannot be built.

        Raises:
            UserError: names the field and a value that works.
        """
        require_counts(self, "radii", "angles", "width", "taps", "hidden", "view_width", "layers", "classes")
        require_rates(self, "view_dropout", "dropout", "drop_path", "head_dropout")
        if not self.reach > 0:
            raise UserError("out-of-range", f"reach is {self.reach} in ViewsConfig", "it must be positive")
        if 2 * max(self.harmonics, self.pooled_harmonics) >= self.angles:
            raise UserError(
                "out-of-range",
                f"harmonics reach {max(self.harmonics, self.pooled_harmonics)} in ViewsConfig",
                f"{self.angles} angles carry frequencies below {self.angles / 2:g}",
            )

    @property
    def channels(self) -> int:
        """Of a crop that are read: coverage alone, or premultiplied colours and coverage."""
        return 4 if self.colour else 1

    @property
    def temporal(self) -> MambaSplatConfig:
        """The Mamba layers, as their stack wants them described."""
        return MambaSplatConfig(
            d_model=self.d_model,
            mamba_layers=self.layers,
            d_state=self.d_state,
            d_conv=self.d_conv,
            expand=self.expand,
            dropout=self.dropout,
            drop_path=self.drop_path,
        )

    def build(self, card: Card, *, key: Key[Array, ""]) -> ViewsClassifier:
        """A classifier with random weights and the given card."""
        # The network is made of this configuration, so its module cannot be imported before this one is.
        from aerojax.classify.views.classifier import ViewsClassifier
        from aerojax.classify.views.model import ViewsNetwork

        return ViewsClassifier(ViewsNetwork(self, key=key), card)

    @property
    def label(self) -> str:
        """Such as views, coverage."""
        return f"views, coverage{' and colour' if self.colour else ''}"

    @property
    def rotation_invariant(self) -> bool:
        """True: no image changes when the world and its cameras turn together, so no answer does."""
        return True
