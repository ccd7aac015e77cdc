"""VN-PointNet, VN-DGCNN and P4Transformer against outputs of the public modules with the same weights.

What this does not reach: training (statistics of batches, dropout, gradients), VN max pooling, sizes of P4Transformer
beyond the stored small one, the released CUDA operators (the stored P4Transformer ran on plain stand-ins for them), and
Mamba4D, of which no reference could be run.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.baseline_weights import DGCNN, POINTNET, filled_network, transformer_tensors, vector_tensors

from aerojax.classify.baselines.config import TransformerSizes, TubeSizes, VectorSizes
from aerojax.classify.baselines.p4transformer import P4Transformer
from aerojax.classify.baselines.tubes import tubes
from aerojax.classify.baselines.vn_dgcnn import VNDGCNN
from aerojax.classify.baselines.vn_pointnet import VNPointNet

VECTOR = {"vn_pointnet": (VNPointNet, POINTNET), "vn_dgcnn": (VNDGCNN, DGCNN)}


@pytest.mark.parametrize("name", VECTOR)
def test_vector_networks_give_the_stored_answers(shared, x64, name):
    golden, (network, layers) = np.load(shared / f"golden/baselines/{name}.npz"), VECTOR[name]
    shapes = jax.eval_shape(lambda key: network(VectorSizes(), 4, dropout=0.5, key=key), jax.random.key(0))
    model = filled_network(shapes, vector_tensors(golden, layers), np.float64)
    points, rotation = golden["input"].swapaxes(1, 2), golden["rotation"]
    forward = jax.jit(lambda model, points: model(points))
    for stored, given in (("output", points), ("output_rotated", points @ rotation), ("output_inverted", -points)):
        logits = forward(model, jnp.asarray(given))
        found = jax.nn.log_softmax(logits) if name == "vn_pointnet" else logits
        np.testing.assert_allclose(found, golden[stored], atol=1e-9, rtol=0, err_msg=stored)


def test_p4transformer_gives_the_stored_stages(shared):
    golden = np.load(shared / "golden/baselines/p4transformer_small.npz")
    sizes = TransformerSizes(
        TubeSizes(radius=0.7, neighbours=8, stride=8), width=32, layers=2, heads=2, head_width=16, hidden=64
    )
    shapes = jax.eval_shape(lambda key: P4Transformer(sizes, 4, key=key), jax.random.key(0))
    model = filled_network(shapes, transformer_tensors(golden), np.float32)

    def stages(model, points):
        count = jnp.asarray(points.shape[0])
        cut = tubes(points, count, sizes.tubes)
        return cut.anchors, model.tube_features(cut), model(points, count)

    anchors, features, logits = jax.jit(jax.vmap(stages, in_axes=(None, 0)))(model, jnp.asarray(golden["input"]))
    np.testing.assert_array_equal(anchors, golden["anchors"])
    np.testing.assert_allclose(features, golden["tube_features"].swapaxes(2, 3), rtol=1e-4, atol=1e-6)
    np.testing.assert_allclose(logits, golden["logits"], rtol=1e-4, atol=1e-6)
