"""The classifiers that there are, by name."""

from __future__ import annotations

from aerojax.classify.base import ClassifierConfig
from aerojax.classify.baselines.config import Mamba4DConfig, P4TransformerConfig, VNDGCNNConfig, VNPointNetConfig
from aerojax.classify.ensemble.config import EnsembleConfig
from aerojax.classify.fused.config import FusedConfig
from aerojax.classify.images.config import B3LiteConfig, B4LiteConfig
from aerojax.classify.mambasplat.config import MambaSplatConfig
from aerojax.classify.views.config import ViewsConfig

MEMBERS: dict[str, type[ClassifierConfig]] = {
    "ensemble": EnsembleConfig,
    "mambasplat": MambaSplatConfig,
    "views": ViewsConfig,
    "fused": FusedConfig,
    "vn_pointnet": VNPointNetConfig,
    "vn_dgcnn": VNDGCNNConfig,
    "p4transformer": P4TransformerConfig,
    "mamba4d": Mamba4DConfig,
    "b3_lite": B3LiteConfig,
    "b4_lite": B4LiteConfig,
}
