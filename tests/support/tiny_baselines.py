"""The baselines at sizes that compile in seconds, with batch norms that know the data."""

from __future__ import annotations

from functools import cache

import jax
import jax.numpy as jnp
import pytest
from support.clip_examples import random_clip

from aerojax.classify.base import CLIP_AXIS, untrained_card, with_card
from aerojax.classify.baselines.classifier import ClipClassifier, FrameClassifier
from aerojax.classify.baselines.config import (
    Mamba4DConfig,
    Mamba4DSizes,
    P4TransformerConfig,
    TransformerSizes,
    TubeSizes,
    VectorSizes,
    VNDGCNNConfig,
    VNPointNetConfig,
)
from aerojax.classify.baselines.mamba4d import Mamba4D
from aerojax.classify.baselines.p4transformer import P4Transformer
from aerojax.classify.baselines.vn_dgcnn import VNDGCNN
from aerojax.classify.baselines.vn_pointnet import VNPointNet
from aerojax.core.tensors import statistics

TIME, TOKENS = 6, 16
TUBES = TubeSizes(radius=0.6, neighbours=4, stride=4)
VECTOR = VectorSizes(width=6, neighbours=5)
TRANSFORMER = TransformerSizes(TUBES, width=16, layers=2, heads=2, head_width=8, hidden=24)
MAMBA4D = Mamba4DSizes(TUBES, width=16, point=(8, 12, 16), position=8, intra=2, inter=2, hidden=24)
FRAME_WISE, CLIP_WISE = ("vn_pointnet", "vn_dgcnn"), ("p4transformer", "mamba4d")


def long(*names: str) -> list:
    """Parameters whose programs take long to compile beside those of a sibling that says the same."""
    return [pytest.param(name, marks=pytest.mark.long) for name in names]


def tiny_classifier(name: str, *, ensembles: int = 1):
    """A baseline with random weights in single precision, whose running statistics are those of a few random clips."""
    with jax.enable_x64(False):
        return with_card(_made(name), token_ensembles=ensembles)


@cache
def _made(name: str):
    key, about = jax.random.key(0), {"tokens": TOKENS, "frames": TIME}
    match name:
        case "vn_pointnet":
            network = VNPointNet(VECTOR, 4, dropout=0.4, key=key)
            made = FrameClassifier(network, untrained_card(VNPointNetConfig(), **about))
        case "vn_dgcnn":
            network = VNDGCNN(VECTOR, 4, dropout=0.5, key=key)
            made = FrameClassifier(network, untrained_card(VNDGCNNConfig(), **about))
        case "p4transformer":
            network = P4Transformer(TRANSFORMER, 4, key=key)
            return ClipClassifier(network, untrained_card(P4TransformerConfig(), **about))
        case _:
            network = Mamba4D(MAMBA4D, Mamba4DConfig(), key=key)
            made = ClipClassifier(network, untrained_card(Mamba4DConfig(), **about))
    return warmed(made)


@jax.jit
def warmed(classifier):
    """The same classifier with running statistics of a batch: in training each says how far it is from them."""
    clips = jnp.stack([random_clip(seed, time=TIME, tokens=TOKENS) for seed in range(100, 104)])

    def total(classifier):
        def heads(clip, key):
            return classifier.training_logits(clip, jnp.ones((TIME, TOKENS), bool), None, key=key)

        return jax.vmap(heads, axis_name=CLIP_AXIS)(clips, jax.random.split(jax.random.key(7), 4)).sum()

    distance = jax.grad(total)(classifier)
    move = lambda leaf, own, gradient: leaf - gradient if own else leaf  # noqa: E731
    return jax.tree.map(move, classifier, statistics(classifier), distance)
