"""The exact classifier does not see rotations, order, padding or the choice of an ellipsoid's quaternion."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.clip_examples import logits_of, other_representative, random_clip, representatives, rotate_columns

from aerojax.classify.mambasplat.config import MambaSplatConfig, published_config
from aerojax.classify.mambasplat.encoder import VNAttention, VNBlock, VNEncoder, VNFeedForward, masked_mean
from aerojax.classify.mambasplat.lifting import ExactLifting, PublishedLifting, normalise_clip
from aerojax.classify.mambasplat.model import MambaSplat
from aerojax.classify.mambasplat.vector_neurons import VNLayerNorm, VNLinear, VNRectifier, VNRMSNorm
from aerojax.geometry.rotations import haar_rotation

ALL = jnp.ones((), bool)
# Modes without shape have no lifting to choose.
MODES = [(m, "covariance") for m in ("C", "C_O", "C_SH", "C_S_R", "C_O_S_R", "X")]
MODES += [(m, "columns") for m in ("C_S_R", "C_O_S_R", "X")]


SMALL = {"depth": 2, "mamba_layers": 1, "d_model": 32}


def _model(seed=0, **changes):
    return MambaSplat(MambaSplatConfig(**{**SMALL, **changes}), key=jax.random.key(seed))


def _rotate_slots(x, rotation):
    return jnp.concatenate([jnp.einsum("ij,...jc->...ic", rotation, x[..., :3, :]), x[..., 3:, :]], axis=-2)


def _equivariance_error(layer, x, rotation):
    return float(jnp.abs(layer(_rotate_slots(x, rotation)) - _rotate_slots(layer(x), rotation)).max())


LAYERS = {
    "linear": lambda c, k: VNLinear(c.channels, 20, key=k),
    "rectifier": lambda c, k: VNRectifier(c.channels, 20, key=k),
    "leaky": lambda c, k: VNRectifier(c.channels, 20, key=k, slope=0.2),
    "rms_norm": lambda c, k: VNRMSNorm(c.channels),
    "layer_norm": lambda c, k: VNLayerNorm(c.channels),
    "attention": lambda c, k: VNAttention(c, key=k),
    "feed_forward": lambda c, k: VNFeedForward(c, key=k),
    "block": lambda c, k: VNBlock(c, key=k),
    "encoder": lambda c, k: VNEncoder(c, key=k),
}


def _call(layer, x):
    masked = isinstance(layer, VNAttention | VNBlock | VNEncoder)
    return layer(x, jnp.ones(x.shape[0], bool)) if masked else layer(x)


@pytest.mark.parametrize("name", LAYERS)
def test_each_layer_commutes_with_rotation(x64, name):
    layer = LAYERS[name](MambaSplatConfig(), jax.random.key(1))
    x = jax.random.normal(jax.random.key(2), (12, 4, 14), jnp.float64)
    rotation = haar_rotation(key=jax.random.key(3)).astype(jnp.float64)
    rotation = jnp.linalg.qr(rotation)[0]
    assert _equivariance_error(lambda x: _call(layer, x), x, rotation) <= 1e-10


@pytest.mark.parametrize(
    "broken",
    [
        lambda x: VNLinear(14, 14, key=jax.random.key(0), bias_epsilon=1e-3)(x),
        lambda x: jax.nn.relu(x),
        lambda x: x / (1 + jnp.abs(x).sum(axis=-2, keepdims=True)),
    ],
    ids=["vector bias", "coordinate-wise rectifier", "one-norm"],
)
def test_the_equivariance_check_catches_broken_layers(x64, broken):
    x = jax.random.normal(jax.random.key(2), (12, 4, 14), jnp.float64)
    rotation = jnp.linalg.qr(haar_rotation(key=jax.random.key(3)).astype(jnp.float64))[0]
    assert _equivariance_error(broken, x, rotation) > 1e-5


@pytest.mark.parametrize("lifting", ["covariance", "columns", "published"])
def test_lifting_commutes_with_rotation(x64, lifting):
    clip = random_clip(0, dtype=np.float64)
    rotation = jnp.linalg.qr(haar_rotation(key=jax.random.key(3)).astype(jnp.float64))[0]
    rotation = rotation * jnp.linalg.det(rotation)
    mask = jnp.ones(clip.shape[:2], bool)
    if lifting == "published":
        layer = PublishedLifting(published_config(bias_epsilon=0.0), key=jax.random.key(1))
        lift = lambda clip: jax.vmap(layer)(clip, mask)  # noqa: E731
    else:
        config = MambaSplatConfig(lifting=lifting)
        layer = ExactLifting(config, key=jax.random.key(1))
        lift = lambda clip: jax.vmap(layer)(normalise_clip(clip, mask, config).columns, mask)  # noqa: E731
    error = jnp.abs(lift(rotate_columns(clip, rotation)) - _rotate_slots(lift(clip), rotation)).max()
    assert error <= 1e-10


@pytest.mark.parametrize(("mode", "lifting"), MODES)
def test_logits_drift_little_under_rotation_in_single_precision(mode, lifting):
    # The mode that is trained and shipped at its full size, the others smaller.
    size = {} if (mode, lifting) == ("X", "covariance") else SMALL
    model = MambaSplat(MambaSplatConfig(mode=mode, lifting=lifting, **size), key=jax.random.key(0))
    clip = random_clip(1)
    rotations = jax.vmap(lambda key: haar_rotation(key=key))(jax.random.split(jax.random.key(4), 32))
    turned = jax.vmap(lambda rotation: rotate_columns(clip, rotation))(rotations)
    drift = jnp.abs(logits_of(model, turned, ALL) - logits_of(model, clip[None], ALL)).max()
    assert drift <= 1e-5


@pytest.mark.parametrize("seeds", ["farthest", "first"])
def test_merged_tokens_do_not_see_rotations(seeds):
    model = _model(merged_tokens=16, merge_seeds=seeds)
    clip = random_clip(1, tokens=96)
    rotations = jax.vmap(lambda key: haar_rotation(key=key))(jax.random.split(jax.random.key(4), 32))
    turned = jax.vmap(lambda rotation: rotate_columns(clip, rotation))(rotations)
    logits = logits_of(model, jnp.concatenate([turned, clip[None], clip[None].at[..., 0].multiply(2.0)]), ALL)
    assert jnp.abs(logits[:32] - logits[32:33]).max() <= 1e-5
    assert jnp.abs(logits[33] - logits[32]).max() > 1e-4


def test_merged_tokens_see_neither_order_nor_padding_nor_quaternions():
    model, clip = _model(merged_tokens=16), random_clip(3, tokens=48)
    shuffled = clip[:, jax.random.permutation(jax.random.key(0), 48)]
    quaternion, permutation = representatives()[7]
    relabelled = other_representative(clip, quaternion, permutation)
    logits = logits_of(model, jnp.stack([clip, shuffled, relabelled]), ALL)
    np.testing.assert_allclose(logits[1:], jnp.broadcast_to(logits[0], (2, 4)), atol=1e-5)
    padded = jnp.concatenate([1e3 * random_clip(5, tokens=8), clip], axis=1)
    mask = jnp.broadcast_to(jnp.arange(56) >= 8, (4, 56))
    np.testing.assert_allclose(logits_of(model, padded[None], mask)[0], logits[0], atol=1e-5)


def test_the_drift_check_catches_the_published_bias():
    model = MambaSplat(published_config("C"), key=jax.random.key(0))
    clip, rotation = random_clip(1), haar_rotation(key=jax.random.key(5))
    clips = jnp.stack([clip, rotate_columns(clip, rotation)])
    logits = logits_of(model, clips, ALL)
    assert jnp.abs(logits[0] - logits[1]).max() > 1e-4


def test_size_and_place_do_not_matter_and_metric_size_brings_size_back():
    clip = random_clip(2)
    larger = clip.at[..., :3].multiply(4.0).at[..., 7:10].multiply(4.0)
    moved = clip.at[..., :3].add(jnp.array([0.5, -1.0, 2.0]))
    logits = logits_of(_model(), jnp.stack([clip, larger, moved]), ALL)
    np.testing.assert_allclose(logits[1:], jnp.broadcast_to(logits[0], (2, 4)), atol=1e-4)
    logits = logits_of(_model(metric_size=True), jnp.stack([clip, larger, moved]), ALL)
    np.testing.assert_allclose(logits[2], logits[0], atol=1e-4)
    assert jnp.abs(logits[1] - logits[0]).max() > 1e-3


def test_token_order_does_not_matter():
    clip = random_clip(3)
    shuffled = clip[:, jax.random.permutation(jax.random.key(0), clip.shape[1])]
    logits = logits_of(_model(), jnp.stack([clip, shuffled]), ALL)
    np.testing.assert_allclose(logits[1], logits[0], atol=1e-5)


@pytest.mark.parametrize("readout", ["mean", "last"])
def test_padding_leaves_no_trace(readout):
    model, clip = _model(readout=readout), random_clip(4, time=3, tokens=20)
    garbage = 1e3 * random_clip(5, time=5, tokens=32)
    # Three real frames among two that were not recorded; twenty real tokens among twelve that are padding.
    padded = garbage.at[jnp.array([0, 2, 3])[:, None], jnp.arange(20)].set(clip)
    mask = jnp.zeros((5, 32), bool).at[jnp.array([0, 2, 3])[:, None], jnp.arange(20)].set(True)
    logits = logits_of(model, padded[None], mask)
    np.testing.assert_allclose(logits, logits_of(model, clip[None], ALL), atol=1e-5)


def _representatives_spread(model, clip):
    """Largest logit change when each Gaussian's quaternion is replaced by another one of the same ellipsoid."""
    others = [other_representative(clip, quaternion, permutation) for quaternion, permutation in representatives()]
    logits = logits_of(model, jnp.stack(others), ALL)
    return float(jnp.abs(logits - logits[:1]).max())


def test_the_quaternion_of_an_ellipsoid_is_not_seen():
    assert len(representatives()) == 24
    clip = random_clip(6)
    assert _representatives_spread(_model(), clip) <= 1e-5
    assert _representatives_spread(_model(lifting="columns"), clip) > 1e-3


@pytest.mark.parametrize("bridge", ["vn_in", "l2_norm", "gram", "pairwise", "pca_frame", "vn_std"])
def test_every_bridge_is_invariant(bridge):
    model, clip = _model(bridge=bridge, invariants_before_pooling=False, depth=1, mamba_layers=1), random_clip(7)
    rotations = jax.vmap(lambda key: haar_rotation(key=key))(jax.random.split(jax.random.key(8), 8))
    turned = jax.vmap(lambda rotation: rotate_columns(clip, rotation))(rotations)
    logits = logits_of(model, jnp.concatenate([turned, clip[None], random_clip(8)[None]]), ALL)
    assert jnp.abs(logits[:8] - logits[8:9]).max() <= 2e-4
    assert jnp.abs(logits[9] - logits[8]).max() > 1e-3


def test_coordinates_are_no_bridge_and_say_so():
    model, clip = _model(bridge="coordinates", invariants_before_pooling=False, depth=1, mamba_layers=1), random_clip(7)
    logits = logits_of(model, jnp.stack([clip, rotate_columns(clip, haar_rotation(key=jax.random.key(8)))]), ALL)
    assert jnp.abs(logits[1] - logits[0]).max() > 1e-2
    assert not model.config.rotation_invariant


def _mirrored_thrice(clip):
    """Add the seven mirror images of round Gaussians in the coordinate planes: symmetry D2h."""
    signs = jnp.array([[a, b, c] for a in (1, -1) for b in (1, -1) for c in (1, -1)], clip.dtype)
    images = [clip.at[..., :3].multiply(sign) for sign in signs]
    return jnp.concatenate(images, axis=1)


def test_symmetric_shapes_keep_token_invariants():
    model = _model(mode="C", depth=2)
    described = []
    for seed in (9, 10):
        clip = _mirrored_thrice(random_clip(seed, time=1, tokens=8))
        mask = jnp.ones(clip.shape[:2], bool)
        columns = normalise_clip(clip, mask, model.config).columns[0]
        tokens = model.encoder(model.lifting(columns, mask[0]), mask[0])
        pooled = model.pool(masked_mean(tokens, mask[0]))
        # The pooled vectors of such a shape vanish, and with them every invariant of theirs.
        assert jnp.abs(model.bridge.invariants(pooled, tokens, mask[0])).max() < 1e-5
        described.append(model.bridge.tokens(tokens, pooled, mask[0]))
    assert jnp.abs(described[0] - described[1]).max() > 1e-2


@pytest.mark.parametrize("merged", [0, 4])
@pytest.mark.parametrize("case", ["one point", "no token", "line", "zero scales"])
def test_gradients_stay_finite_at_degenerate_clips(case, merged):
    clip, mask = random_clip(11, time=2, tokens=8), jnp.ones((2, 8), bool)
    if case == "one point":
        clip = jnp.broadcast_to(clip[:1, :1], clip.shape)
    elif case == "line":
        clip = clip.at[..., 1:3].set(0.0)
    elif case == "zero scales":
        clip = clip.at[..., 7:10].set(0.0)
    else:
        mask = jnp.zeros_like(mask)
    gradients = _input_gradient(_model(depth=2, mamba_layers=1, merged_tokens=merged), clip, mask)
    assert all(bool(jnp.isfinite(leaf).all()) for leaf in jax.tree.leaves(gradients))


@jax.jit
def _input_gradient(model, clip, mask):
    return jax.grad(lambda model, clip: jnp.sum(model(clip, mask) ** 2), argnums=(0, 1))(model, clip)
