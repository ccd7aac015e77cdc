"""What the baselines are made of: a size, and what may be changed without being another network."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Literal

from jaxtyping import Array, Key

from aerojax.classify.base import ClassifierConfig, require_counts, require_rates
from aerojax.classify.baselines.clouds import Normalisation
from aerojax.classify.card import Card
from aerojax.core.types import CLASSES

if TYPE_CHECKING:
    from aerojax.classify.baselines.classifier import ClipClassifier, FrameClassifier

Size = Literal["full", "small"]
"""As published, or few enough numbers to be trained on two processor cores."""


@dataclasses.dataclass(frozen=True)
class VectorSizes:
    """Sizes of VN-PointNet and VN-DGCNN.

    width: features of the narrowest layer; a third of them, rounded down, are its vectors.
    neighbours: of a token that are read, itself among them.
    """

    width: int = 64
    neighbours: int = 20

    @property
    def channels(self) -> tuple[int, int, int, int, int]:
        """Vectors of layers of 1, 2, 4, 8 and 16 times the width."""
        one, two, four, eight, sixteen = (times * self.width // 3 for times in (1, 2, 4, 8, 16))
        return one, two, four, eight, sixteen

    @property
    def hidden(self) -> tuple[int, int]:
        """Of the head's two layers."""
        return 8 * self.width, 4 * self.width


@dataclasses.dataclass(frozen=True)
class TubeSizes:
    """How P4Transformer and Mamba4D cut a clip into tubes.

    radius: of a tube, in the unit of the normalised points. neighbours: points of it in each of three frames.
    stride: points of a frame for each tube.
    """

    radius: float = 0.7
    neighbours: int = 32
    stride: int = 32


@dataclasses.dataclass(frozen=True)
class TransformerSizes:
    """Sizes of P4Transformer: of the tubes, of a token, of the layers, and of the hidden layers after attention."""

    tubes: TubeSizes = TubeSizes()
    width: int = 1024
    layers: int = 5
    heads: int = 8
    head_width: int = 128
    hidden: int = 2048


@dataclasses.dataclass(frozen=True)
class Mamba4DSizes:
    """Sizes of Mamba4D.

    tubes: of the tubes. width: of a token. point: channels of the point encoder's layers before the last.
    position: of the hidden layer that reads where a tube is.
    intra, inter: layers within a frame's tubes and over all of them. hidden: of the head.
    """

    tubes: TubeSizes = TubeSizes()
    width: int = 1024
    point: tuple[int, int, int] = (128, 256, 512)
    position: int = 128
    intra: int = 12
    inter: int = 4
    hidden: int = 2048


_FEW_POINTS = TubeSizes(radius=0.5, neighbours=8, stride=4)
"""Tubes for frames of some 64 points: 16 of them, of half the cloud's radius, where 1,024 points have 32."""
VECTOR_SIZES: dict[Size, VectorSizes] = {"full": VectorSizes(), "small": VectorSizes(width=24, neighbours=10)}
TRANSFORMER_SIZES: dict[Size, TransformerSizes] = {
    "full": TransformerSizes(),
    "small": TransformerSizes(_FEW_POINTS, width=96, layers=3, heads=4, head_width=24, hidden=192),
}
MAMBA4D_SIZES: dict[Size, Mamba4DSizes] = {
    "full": Mamba4DSizes(),
    "small": Mamba4DSizes(_FEW_POINTS, width=96, point=(32, 48, 96), position=32, intra=2, inter=2, hidden=192),
}


@dataclasses.dataclass(frozen=True)
class _FrameConfig(ClassifierConfig):
    size: Size = "full"
    scale_normalisation: Literal["frame", "none"] = "frame"
    dropout: float = 0.4
    classes: int = len(CLASSES)

    def __post_init__(self) -> None:
        """Refuse what cannot be built.

        Raises:
            UserError: names the field and a value that works.
        """
        require_counts(self, "classes")
        require_rates(self, "dropout")

    @property
    def rotation_invariant(self) -> bool:
        """True: what is read of a frame are products of vectors that turn together."""
        return True


@dataclasses.dataclass(frozen=True)
class VNPointNetConfig(_FrameConfig):
    """VN-PointNet (Deng et al. 2021) on the positions of single frames, whose probabilities are averaged.

    size: as published (1,965,035 parameters with 10 classes), or one for two cores.
    scale_normalisation: whether each frame is centred and divided by its radius.
    dropout: rate of dropout before the answer. classes: number of answers.
    """

    name: Literal["vn_pointnet"] = "vn_pointnet"

    def build(self, card: Card, *, key: Key[Array, ""]) -> FrameClassifier:
        """A classifier with random weights and the given card."""
        # The networks are made of these configurations, so their modules cannot be imported before this one is.
        from aerojax.classify.baselines.classifier import FrameClassifier
        from aerojax.classify.baselines.vn_pointnet import VNPointNet

        network = VNPointNet(VECTOR_SIZES[self.size], self.classes, dropout=self.dropout, key=key)
        return FrameClassifier(network, card)

    @property
    def label(self) -> str:
        """Such as VN-PointNet, full."""
        return f"VN-PointNet, {self.size}"


@dataclasses.dataclass(frozen=True)
class VNDGCNNConfig(_FrameConfig):
    """VN-DGCNN (Deng et al. 2021) on the positions of single frames, whose probabilities are averaged.

    size: as published (2,892,120 parameters with 10 classes), or one for two cores.
    scale_normalisation: whether each frame is centred and divided by its radius.
    dropout: rate of dropout before the answer. classes: number of answers.
    """

    name: Literal["vn_dgcnn"] = "vn_dgcnn"
    dropout: float = 0.5

    def build(self, card: Card, *, key: Key[Array, ""]) -> FrameClassifier:
        """A classifier with random weights and the given card."""
        from aerojax.classify.baselines.classifier import FrameClassifier
        from aerojax.classify.baselines.vn_dgcnn import VNDGCNN

        return FrameClassifier(VNDGCNN(VECTOR_SIZES[self.size], self.classes, dropout=self.dropout, key=key), card)

    @property
    def label(self) -> str:
        """Such as VN-DGCNN, full."""
        return f"VN-DGCNN, {self.size}"


@dataclasses.dataclass(frozen=True)
class P4TransformerConfig(ClassifierConfig):
    """P4Transformer (Fan et al. 2021) on the positions of a clip; it looks ahead and sees rotations.

    size: as published (44,102,660 parameters with 4 classes), or one for two cores.
    scale_normalisation: what the clip is centred and divided by: frame by frame, once, or not at all.
    classes: number of answers.
    """

    name: Literal["p4transformer"] = "p4transformer"
    size: Size = "full"
    scale_normalisation: Normalisation = "frame"
    classes: int = len(CLASSES)

    def __post_init__(self) -> None:
        """Refuse what cannot be built.

        Raises:
            UserError: names the field and a value that works.
        """
        require_counts(self, "classes")

    def build(self, card: Card, *, key: Key[Array, ""]) -> ClipClassifier:
        """A classifier with random weights and the given card."""
        from aerojax.classify.baselines.classifier import ClipClassifier
        from aerojax.classify.baselines.p4transformer import P4Transformer

        return ClipClassifier(P4Transformer(TRANSFORMER_SIZES[self.size], self.classes, key=key), card)

    @property
    def label(self) -> str:
        """Such as P4Transformer, full."""
        return f"P4Transformer, {self.size}"

    @property
    def rotation_invariant(self) -> bool:
        """False: coordinates are read as they are."""
        return False


@dataclasses.dataclass(frozen=True)
class Mamba4DConfig(ClassifierConfig):
    """Mamba4D (Liu et al. 2025) on the positions of a clip; it looks ahead and sees rotations.

    size: as published (109,768,836 parameters with 4 classes, without the 4,096 that its code makes and never reads),
        or one for two cores.
    scale_normalisation: what the clip is centred and divided by: frame by frame, once, or not at all.
    true_sort: whether tubes are put in the order of their coordinates, as the paper says, instead of the order that the
        released code makes (`mamba4d.tube_order`).
    dropout: of the layers' outputs. drop_path: of whole layers, the same for each.
    classes: number of answers.
    """

    name: Literal["mamba4d"] = "mamba4d"
    size: Size = "full"
    scale_normalisation: Normalisation = "frame"
    true_sort: bool = False
    dropout: float = 0.1
    drop_path: float = 0.1
    classes: int = len(CLASSES)

    def __post_init__(self) -> None:
        """Refuse what cannot be built.

        Raises:
            UserError: names the field and a value that works.
        """
        require_counts(self, "classes")
        require_rates(self, "dropout", "drop_path")

    def build(self, card: Card, *, key: Key[Array, ""]) -> ClipClassifier:
        """A classifier with random weights and the given card."""
        from aerojax.classify.baselines.classifier import ClipClassifier
        from aerojax.classify.baselines.mamba4d import Mamba4D

        return ClipClassifier(Mamba4D(MAMBA4D_SIZES[self.size], self, key=key), card)

    @property
    def label(self) -> str:
        """Such as Mamba4D, full."""
        return f"Mamba4D, {self.size}{', sorted' if self.true_sort else ''}"

    @property
    def rotation_invariant(self) -> bool:
        """False: coordinates are read as they are."""
        return False
