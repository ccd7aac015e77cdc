"""VN-DGCNN: edge convolutions over nearest neighbours in feature space (Deng et al. 2021, §4; vnn's `vn_dgcnn_cls`).

Mean pooling over neighbours, as the published defaults have it. Made of linear maps and lengths alone, the network does
not tell a frame from its mirror image either.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
from flax import nnx
from jaxtyping import Array, Float, Key

from aerojax.classify.baselines.clouds import nearest
from aerojax.classify.baselines.config import VectorSizes
from aerojax.classify.baselines.vector_layers import Counts, FrameHead, VNLinearLeakyReLU, VNStdFeature, with_mean

_SLOPE = 0.2


class VNDGCNN(nnx.Module):
    """The network; rows of its input are frames, each classified alone."""

    def __init__(self, sizes: VectorSizes, classes: int, *, dropout: float, key: Key[Array, ""]):
        one, two, four, _, sixteen = sizes.channels
        edges, joint, invariants, head = jax.random.split(key, 4)
        pairs, keys = ((2, one), (2 * one, one), (2 * one, two), (2 * two, four)), jax.random.split(edges, 4)
        first, second, third, fourth = (
            VNLinearLeakyReLU(*pair, slope=_SLOPE, key=each) for pair, each in zip(pairs, keys, strict=True)
        )
        self.neighbours = sizes.neighbours
        self.first, self.second, self.third, self.fourth = first, second, third, fourth
        self.joint = VNLinearLeakyReLU(2 * one + two + four, sixteen, slope=_SLOPE, key=joint, shared=True)
        self.invariants = VNStdFeature(2 * sixteen, slope=_SLOPE, key=invariants)
        self.head = FrameHead(12 * sixteen, sizes.hidden, classes, slope=_SLOPE, rate=dropout, early=False, key=head)

    def __call__(
        self, points: Float[Array, "row token 3"], counts: Counts = None, *, key: Key[Array, ""] | None = None
    ) -> Float[Array, "row label"]:
        """Logits of every frame; arguments as of `VNPointNet`."""
        x, found = points[..., None], []
        for layer in (self.first, self.second, self.third, self.fourth):
            x = layer(edge_vectors(x, self.neighbours), counts).mean(axis=2)
            found.append(x)
        x = with_mean(self.joint(jnp.concatenate(found, axis=-1), counts))
        invariants = self.invariants(x, counts)
        pooled = jnp.concatenate([invariants.max(axis=1), invariants.mean(axis=1)], axis=-1)
        return self.head(pooled, counts, key=key)


def edge_vectors(x: Float[Array, "row token 3 channel"], count: int) -> Float[Array, "row token near 3 twice_channel"]:
    """For each neighbour of a token in the space of all its vectors: their differences, and the token's own."""
    near = jax.vmap(lambda frame: frame[nearest(frame.reshape(frame.shape[0], -1), count)])(x)
    here = jnp.broadcast_to(x[:, :, None], near.shape)
    return jnp.concatenate([near - here, here], axis=-1)
