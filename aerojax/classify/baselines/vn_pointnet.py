"""VN-PointNet: a frame's points in, logits out, invariant to rotations (Deng et al. 2021, §4; vnn's `vn_pointnet_cls`).

Mean pooling over neighbours and in the feature transform, as the published defaults have it.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
from flax import nnx
from jaxtyping import Array, Float, Key

from aerojax.classify.baselines.clouds import nearest
from aerojax.classify.baselines.config import VectorSizes
from aerojax.classify.baselines.vector_layers import (
    Counts,
    FrameHead,
    VNBatchNorm,
    VNLinearLeakyReLU,
    VNStdFeature,
    with_mean,
)
from aerojax.classify.mambasplat.layers import Linear


class FeatureTransform(nnx.Module):
    """Vectors of a whole frame that join those of its tokens: a small VN-PointNet of its own."""

    def __init__(self, sizes: VectorSizes, *, key: Key[Array, ""]):
        one, two, four, eight, sixteen = sizes.channels
        keys = jax.random.split(key, 6)
        pairs = (one, one), (one, two), (two, sixteen), (sixteen, eight), (eight, four)
        first, second, third, fourth, fifth = (
            VNLinearLeakyReLU(*pair, slope=0.0, key=each) for pair, each in zip(pairs, keys, strict=False)
        )
        self.first, self.second, self.third, self.fourth, self.fifth = first, second, third, fourth, fifth
        self.out = Linear(four, one, key=keys[5], bias=False)

    def __call__(self, x: Float[Array, "row token 3 channel"], counts: Counts = None) -> Float[Array, "row 3 channel"]:
        """Rectified layers, the mean over tokens, rectified layers, a linear map."""
        x = self.third(self.second(self.first(x, counts), counts), counts).mean(axis=1)
        return self.out(self.fifth(self.fourth(x, counts), counts))


class VNPointNet(nnx.Module):
    """The network; rows of its input are frames, each classified alone."""

    def __init__(self, sizes: VectorSizes, classes: int, *, dropout: float, key: Key[Array, ""]):
        one, two, _, _, sixteen = sizes.channels
        names = "position", "first", "transform", "second", "third", "invariants", "head"
        keys = dict(zip(names, jax.random.split(key, len(names)), strict=True))
        self.neighbours = sizes.neighbours
        self.position = VNLinearLeakyReLU(3, one, slope=0.0, key=keys["position"])
        self.first = VNLinearLeakyReLU(one, one, slope=0.0, key=keys["first"])
        self.transform = FeatureTransform(sizes, key=keys["transform"])
        self.second = VNLinearLeakyReLU(2 * one, two, slope=0.0, key=keys["second"])
        self.third = Linear(two, sixteen, key=keys["third"], bias=False)
        self.third_norm = VNBatchNorm(sixteen)
        self.invariants = VNStdFeature(2 * sixteen, slope=0.0, key=keys["invariants"])
        self.head = FrameHead(6 * sixteen, sizes.hidden, classes, slope=0.0, rate=dropout, early=True, key=keys["head"])

    def __call__(
        self, points: Float[Array, "row token 3"], counts: Counts = None, *, key: Key[Array, ""] | None = None
    ) -> Float[Array, "row label"]:
        """Logits of every frame.

        Args:
            points: of any number of frames.
            counts: turns on the statistics of training, as `BatchNorm`.
            key: turns on dropout.
        """
        x = self.position(crossed_neighbours(points, self.neighbours), counts).mean(axis=2)
        x = self.first(x, counts)
        frame = jnp.broadcast_to(self.transform(x, counts)[:, None], x.shape)
        x = self.second(jnp.concatenate([x, frame], axis=-1), counts)
        x = with_mean(self.third_norm(self.third(x), counts))
        return self.head(self.invariants(x, counts).max(axis=1), counts, key=key)


def crossed_neighbours(points: Float[Array, "row token 3"], count: int) -> Float[Array, "row token near 3 3"]:
    """For each neighbour x_j of x_i the vectors x_j - x_i, x_i and x_j × x_i.

    The product keeps handedness: a mirrored frame has other logits, a turned one has the same.
    """
    near = jax.vmap(lambda frame: frame[nearest(frame, count)])(points)
    here = jnp.broadcast_to(points[:, :, None], near.shape)
    return jnp.stack([near - here, here, jnp.cross(near, here)], axis=-1)
