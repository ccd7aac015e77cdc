"""Parameters and operations of every network at once: published totals, ours, and what the programs multiply."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import pytest
from support.traced_programs import matrix_products

from aerojax.classify.base import ClassifierConfig, untrained
from aerojax.classify.baselines import cost as baseline_cost
from aerojax.classify.baselines.config import (
    TRANSFORMER_SIZES,
    Mamba4DConfig,
    P4TransformerConfig,
    VNDGCNNConfig,
    VNPointNetConfig,
)
from aerojax.classify.baselines.cost import parameter_count, unread_parameters
from aerojax.classify.fused.config import FusedConfig
from aerojax.classify.images.config import B3LiteConfig, B4LiteConfig, CropConfig
from aerojax.classify.mambasplat import cost as mambasplat_cost
from aerojax.classify.mambasplat.config import MambaSplatConfig, published_config
from aerojax.classify.views.config import ViewsConfig
from aerojax.core.types import Crops

FRAMES, TOKENS = 24, 1024
VIEWS, PIXELS = 4, 32
# Configuration; parameters; those that a published total has beside them; 10⁹ operations of a clip at T = 24, N = 1024,
# four views. P4Transformer, Mamba4D and the published MambaSplat: Table 6.19 of the thesis to its two decimals.
NETWORKS: dict[str, tuple[ClassifierConfig, int, int, float]] = {
    "VN-PointNet, 10 classes": (VNPointNetConfig(classes=10), 1_965_035, 0, 94.03),
    "VN-PointNet, 40 classes": (VNPointNetConfig(classes=40), 1_972_745, 0, 94.04),
    "VN-DGCNN, 10 classes": (VNDGCNNConfig(classes=10), 2_892_120, 0, 165.49),
    "VN-DGCNN, 40 classes": (VNDGCNNConfig(classes=40), 2_899_830, 0, 165.49),
    "P4Transformer": (P4TransformerConfig(), 44_102_660, 0, 35.54),
    "P4Transformer, 20 classes": (P4TransformerConfig(classes=20), 44_135_444, 0, 35.54),
    "Mamba4D": (Mamba4DConfig(), 109_768_836, 4_096, 304.74),
    "Mamba4D, 20 classes": (Mamba4DConfig(classes=20), 109_801_620, 4_096, 304.74),
    "published E(C)": (published_config("C"), 1_839_544, 12_934, 44.42),
    "published E(X)": (published_config("X"), 1_853_922, 27_270, 103.54),
    "MambaSplat": (MambaSplatConfig(), 1_857_506, 0, 55.24),
    "views": (ViewsConfig(), 396_036, 0, 0.22),
    "fused": (FusedConfig(), 2_321_002, 0, 56.26),
    "VN-PointNet, small": (VNPointNetConfig(size="small"), 278_404, 0, 13.51),
    "VN-DGCNN, small": (VNDGCNNConfig(size="small"), 408_580, 0, 22.64),
    "P4Transformer, small": (P4TransformerConfig(size="small"), 243_940, 0, 12.29),
    "Mamba4D, small": (Mamba4DConfig(size="small"), 317_972, 384, 7.72),
    "B3-lite on crops": (B3LiteConfig(), 116_900, 0, 1.59),
    "B4-lite": (B4LiteConfig(), 98_468, 0, 0.68),
}


def beside(config: ClassifierConfig) -> int:
    """Numbers that the published code stores and never reads."""
    if isinstance(config, MambaSplatConfig):
        return mambasplat_cost.unused_bridge_parameters(config)
    return unread_parameters(config) if isinstance(config, baseline_cost.BaselineConfig) else 0


def operations(config: Any) -> int:
    """Of a clip of `FRAMES` frames of `TOKENS` tokens, by formula; for networks that read images from their program."""
    if not isinstance(config, ViewsConfig | FusedConfig | CropConfig):
        cost = mambasplat_cost if isinstance(config, MambaSplatConfig) else baseline_cost
        return cost.operations(config, FRAMES, TOKENS)
    shape = jax.ShapeDtypeStruct
    crops = shape((FRAMES, VIEWS, PIXELS, PIXELS, 4), jnp.float32), shape((FRAMES, VIEWS), bool)
    seen = shape((FRAMES, TOKENS, 14), jnp.float32), shape((FRAMES, TOKENS), bool), *crops
    made = jax.eval_shape(lambda key: untrained(config, tokens=1, frames=1, key=key), jax.random.key(0))

    def read(made: Any, columns: Any, mask: Any, *crops: Any) -> Any:
        return made.logits(columns, mask, Crops(*crops))

    return 2 * matrix_products(jax.make_jaxpr(read)(made, *seen).jaxpr)


@pytest.mark.parametrize("name", NETWORKS)
def test_parameters_and_operations(name):
    config, parameters, more, billions = NETWORKS[name]
    assert (parameter_count(config), beside(config)) == (parameters, more)
    assert round(operations(config) / 1e9, 2) == billions


SMALL_AND_FULL = [
    kind(size=size)
    for kind in (VNPointNetConfig, VNDGCNNConfig, P4TransformerConfig, Mamba4DConfig)
    for size in ("small", "full")
]


@pytest.mark.parametrize("config", SMALL_AND_FULL, ids=lambda config: config.label)
def test_operations_of_baselines_are_the_matrix_products_of_their_programs(config):
    """Traced, not run: full sizes cost nothing here."""
    frames, tokens = 8, 128
    network = jax.eval_shape(lambda key: untrained(config, tokens=1, frames=1, key=key).network, jax.random.key(0))
    points = jax.ShapeDtypeStruct((frames, tokens, 3), jnp.float32)
    if isinstance(config, VNPointNetConfig | VNDGCNNConfig):
        traced, head = jax.make_jaxpr(lambda network, points: network(points))(network, points), 0
    else:
        count = jax.ShapeDtypeStruct((), jnp.int32)
        traced = jax.make_jaxpr(lambda network, *clip: network(*clip))(network, points, count)
        width, hidden = network.position.weight.shape[0], network.head.hidden.weight.shape[0]
        head = width * hidden + hidden * config.classes  # a single vector
    found = matrix_products(traced.jaxpr) + head
    assert baseline_cost.operations(config, frames, tokens) == 2 * found


def test_full_sizes_are_as_published():
    tubes = TRANSFORMER_SIZES["full"].tubes
    assert (tubes.radius, tubes.neighbours, tubes.stride) == (0.7, 32, 32)
