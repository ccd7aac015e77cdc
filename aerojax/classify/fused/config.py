"""What a fused model is made of: the configurations of its two paths, and how they are joined."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Literal

from jaxtyping import Array, Key

from aerojax.classify.base import ClassifierConfig, require_counts
from aerojax.classify.card import Card
from aerojax.classify.mambasplat.config import MambaSplatConfig
from aerojax.classify.views.config import ViewsConfig
from aerojax.core.errors import UserError

if TYPE_CHECKING:
    from aerojax.classify.fused.classifier import FusedClassifier


@dataclasses.dataclass(frozen=True)
class FusedConfig(ClassifierConfig):
    """The two paths and their joint head.

    gaussians, views: configurations of the paths.
    hidden: width of the joint head.
    path_dropout: probability that a training clip is answered without one of its paths, each as often as the other.
    head_dropout: dropout rate in the joint head.
    """

    name: Literal["fused"] = "fused"
    gaussians: MambaSplatConfig = dataclasses.field(default_factory=MambaSplatConfig)
    views: ViewsConfig = dataclasses.field(default_factory=ViewsConfig)
    hidden: int = 128
    path_dropout: float = 0.3
    head_dropout: float = 0.1

    def __post_init__(self) -> None:
        """Refuse what cannot be built.

        Raises:
            UserError: names the field and a value that works.
        """
        require_counts(self, "hidden")
        for name, most in (("path_dropout", 1.0), ("head_dropout", 0.99)):
            if not 0 <= getattr(self, name) <= most:
                problem = f"{name} is {getattr(self, name)} in FusedConfig"
                raise UserError("out-of-range", problem, f"a rate lies in [0, {most:g}]")
        if self.gaussians.variant != "exact":
            problem = f"gaussians.variant is {self.gaussians.variant!r} in FusedConfig"
            raise UserError("mismatch", problem, "set it to 'exact': the other one counts frames that do not exist")
        if self.gaussians.classes != self.views.classes:
            problem = f"gaussians.classes is {self.gaussians.classes} and views.classes {self.views.classes}"
            raise UserError("mismatch", f"{problem} in FusedConfig", "set them alike")

    def build(self, card: Card, *, key: Key[Array, ""]) -> FusedClassifier:
        """A classifier with random weights and the given card."""
        # The network is made of this configuration, so its module cannot be imported before this one is.
        from aerojax.classify.fused.classifier import FusedClassifier
        from aerojax.classify.fused.model import FusedNetwork

        return FusedClassifier(FusedNetwork(self, key=key), card)

    @property
    def label(self) -> str:
        """Both paths' labels."""
        return f"{self.gaussians.label} with {self.views.label}"

    @property
    def rotation_invariant(self) -> bool:
        """Whether no rotation of world and cameras together changes the logits: where the Gaussian path has none."""
        return self.gaussians.rotation_invariant
