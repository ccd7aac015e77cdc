"""What a MambaSplat model is made of: one frozen dataclass, refused where its fields contradict each other."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any, Literal

from jaxtyping import Array, Key

from aerojax.classify.base import ClassifierConfig, require_counts, require_rates
from aerojax.classify.card import Card
from aerojax.classify.mambasplat.motion import feature_count
from aerojax.core.errors import UserError
from aerojax.core.types import CLASSES
from aerojax.gaussians.merge import Seeds

if TYPE_CHECKING:
    from aerojax.classify.mambasplat.classifier import MambaSplatClassifier

Mode = Literal["C", "C_O", "C_SH", "C_S_R", "C_O_S_R", "X"]
"""Attributes that the model reads: centres C, opacity O, colour SH, scales and rotations S_R; X is all of them."""

Bridge = Literal["vn_in", "l2_norm", "gram", "pairwise", "pca_frame", "vn_std", "coordinates"]
"""Invariants of vectors; `coordinates` are none, they are the control that sees how the world is turned."""


def uses_opacity(mode: Mode) -> bool:
    """Whether the mode reads opacity."""
    return mode in ("C_O", "C_O_S_R", "X")


def uses_colour(mode: Mode) -> bool:
    """Whether the mode reads the DC colour coefficient."""
    return mode in ("C_SH", "X")


def uses_shape(mode: Mode) -> bool:
    """Whether the mode reads scales and rotations."""
    return mode in ("C_S_R", "C_O_S_R", "X")


@dataclasses.dataclass(frozen=True)
class MambaSplatConfig(ClassifierConfig):
    """Size, operators and input of a MambaSplat model.

    The defaults are the exact variant; `published_config` gives the thesis' released model. `variant` chooses the
    operators (norms, initialisation, biases), every other field can be changed alone. Rates are probabilities.

    variant: operators, "published" as the released code has them or "exact" under rotations.
    mode: attributes that are read: centres C, opacity O, colour SH, scales and rotations S_R; X is all of them.
    lifting: how scales and rotations become vectors, their columns or the covariance's.
    channels: vector channels of a token. heads, head_dim: of the attention over a frame's tokens. depth: its layers.
    pre_norm: whether norms stand before the layers.
    bridge: how a frame's vectors become invariants. invariants_before_pooling: of each token, or of the frame's mean.
    token_invariants, token_features: invariants of a token, and channels that a layer makes of them.
    temporal: layers over time, or a mean. readout: mean over the frames, or the last frame.
    positional_encoding: whether frames are told apart by sines of their number.
    d_model, mamba_layers, d_state, d_conv, expand: of the Mamba layers over time.
    dropout: of the layers' outputs. drop_path: of whole layers. head_dropout: before the answer.
    classes: number of answers.
    """

    name: Literal["mambasplat"] = "mambasplat"
    variant: Literal["published", "exact"] = "exact"
    mode: Mode = "X"
    lifting: Literal["columns", "covariance"] = "covariance"
    scale_normalisation: Literal["clip", "robust", "running", "frame", "none"] = "running"
    """Length that positions are divided by: root mean square distance over the clip, median distance over the clip
    (floaters far away do not count), root mean square over the frames so far, over each frame alone, or 1."""
    scalar_slots: int = 1
    """Invariant slots of a token (exact variant only; the published one has one per attribute)."""
    metric_size: bool = False
    """Whether log(radius in metres) is a feature: it lifts scale invariance."""
    motion_features: bool = False
    """Whether speed, turn and change of shape from frame to frame are features (`motion`): they lift invariance to
    rotations of single frames, not to those of the clip."""
    shape_features: bool = False
    """Whether invariants of each frame's cloud are features: principal extents, radius quantiles, third moments."""
    flight_features: bool = False
    """Whether smoothed speed, turn, bend and the extent along the flight are features, lengths in radii."""
    spectrum_features: bool = False
    """Whether the amplitudes of the shape invariants' swings over the last 16 frames are features, up to Nyquist."""
    merged_tokens: int = 0
    """Gaussians that each frame's tokens are merged into by their moments before they are read; 0 reads the tokens as
    they come. Radius and centre are those of all tokens."""
    merge_seeds: Seeds = "farthest"
    """Where the merged Gaussians begin (`gaussians.merge`): "farthest" spreads them and does not see the tokens' order;
    only where two tokens are equally far within rounding may a turned frame begin elsewhere. "first" begins at the
    first tokens of a frame, which decides nothing by geometry."""
    merge_steps: int = 2
    """How often the seeds move to the means of their tokens."""
    channels: int = 14
    heads: int = 4
    head_dim: int = 8
    depth: int = 4
    pre_norm: bool = True
    bias_epsilon: float = 1e-6
    """Size of the published variant's vector bias, which breaks equivariance; 0 leaves the biases out."""
    bridge: Bridge = "vn_in"
    invariants_before_pooling: bool = True
    token_invariants: int = 32
    token_features: int = 64
    temporal: Literal["mamba", "none"] = "mamba"
    readout: Literal["mean", "last"] = "mean"
    positional_encoding: bool = False
    d_model: int = 256
    mamba_layers: int = 4
    d_state: int = 16
    d_conv: int = 4
    expand: int = 2
    dropout: float = 0.05
    drop_path: float = 0.1
    head_dropout: float = 0.1
    classes: int = len(CLASSES)

    def __post_init__(self) -> None:
        """Refuse what cannot be built.

        Raises:
            UserError: names the field and a value that works.
        """
        counts = "scalar_slots", "channels", "heads", "head_dim", "depth", "d_model", "mamba_layers", "classes"
        require_counts(self, *counts)
        require_counts(self, "merged_tokens", "merge_steps", least=0)
        if self.merged_tokens and self.lifting == "columns" and uses_shape(self.mode):
            raise UserError(
                "mismatch",
                "lifting is 'columns' in MambaSplatConfig, but merged Gaussians have covariances and no axes",
                "set lifting to 'covariance' or merged_tokens to 0",
            )
        require_rates(self, "dropout", "drop_path", "head_dropout")
        if self.d_model % 2:
            raise UserError("out-of-range", f"d_model is {self.d_model} in MambaSplatConfig", "it must be even")
        if self.variant == "published":
            self._refuse_unless_published()

    @property
    def looks_ahead(self) -> str | None:
        """The field and value for which a frame is read otherwise because of its neighbours in the clip, if any."""
        if self.variant == "published":
            return "variant is 'published', which counts frames that were not recorded"
        if self.scale_normalisation in ("clip", "robust"):
            return f"scale_normalisation is {self.scale_normalisation!r}, not 'running', 'frame' or 'none'"
        return "positional_encoding is True, not False" if self.positional_encoding else None

    def build(self, card: Card, *, key: Key[Array, ""]) -> MambaSplatClassifier:
        """A classifier with random weights and the given card."""
        # The network is made of this configuration, so its module cannot be imported before this one is.
        from aerojax.classify.mambasplat.classifier import MambaSplatClassifier
        from aerojax.classify.mambasplat.model import MambaSplat

        return MambaSplatClassifier(MambaSplat(self, key=key), card)

    @property
    def label(self) -> str:
        """Such as MambaSplat-4D E(X), exact variant."""
        return f"MambaSplat-4D E({self.mode}), {self.variant} variant"

    @property
    def rotation_invariant(self) -> bool:
        """Whether no rotation of the world changes the logits: the published variant has biases with directions."""
        return self.variant == "exact" and self.bridge != "coordinates"

    def _refuse_unless_published(self) -> None:
        for name, needed in PUBLISHED.items():
            if getattr(self, name) != needed:
                raise UserError(
                    "mismatch",
                    f"{name} is {getattr(self, name)!r} in MambaSplatConfig, but variant "
                    f"'published' has no such part: set {name} to {needed!r} or variant to 'exact'",
                )


def frame_extras(config: MambaSplatConfig) -> int:
    """How many invariants of a frame join its descriptor besides the bridge's."""
    return config.metric_size + feature_count(config)


PUBLISHED: dict[str, Any] = {
    "lifting": "columns",
    "merged_tokens": 0,
    "scale_normalisation": "none",
    "scalar_slots": 1,
    "metric_size": False,
    "motion_features": False,
    "shape_features": False,
    "flight_features": False,
    "spectrum_features": False,
    "pre_norm": False,
    "invariants_before_pooling": False,
}


def published_config(mode: Mode = "X", **changes: Any) -> MambaSplatConfig:
    """The released model's configuration; `changes` are fields of `MambaSplatConfig`."""
    fields: dict[str, Any] = {"variant": "published", "mode": mode, "positional_encoding": True, **PUBLISHED, **changes}
    return MambaSplatConfig(**fields)
