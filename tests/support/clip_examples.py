"""Clips of random Gaussians and rotations of their 14 columns, for the tests of the classifier."""

from __future__ import annotations

import itertools

import jax
import jax.numpy as jnp
import numpy as np

from aerojax.geometry.rotations import canonical_sign, normalise, quaternion_from_rotation, quaternion_multiply

BATCH = 4


def random_clip(seed, time=4, tokens=48, dtype=np.float32, anisotropy=1.0):
    """Metric Gaussians of an elongated, asymmetric cloud about a point near the origin."""
    rng = np.random.default_rng(seed)
    position = rng.normal(size=(time, tokens, 3)) * [1.0, 0.5, 0.2] + rng.exponential(0.3, (time, tokens, 3))
    quaternion = rng.normal(size=(time, tokens, 4))
    scale = 0.05 * np.exp(anisotropy * rng.normal(size=(time, tokens, 3)))
    opacity, colour = rng.uniform(0.1, 1, (time, tokens, 1)), rng.normal(size=(time, tokens, 3))
    quaternion /= np.linalg.norm(quaternion, axis=-1, keepdims=True)
    return jnp.asarray(np.concatenate([position, quaternion, scale, opacity, colour], axis=-1).astype(dtype))


def rotate_columns(columns, rotation):
    """World rotation of Gaussians: p → Rp, q → q_R ⊗ q."""
    turn = jnp.broadcast_to(quaternion_from_rotation(rotation), columns[..., 3:7].shape)
    quaternion = canonical_sign(normalise(quaternion_multiply(turn, columns[..., 3:7])))
    return jnp.concatenate([columns[..., :3] @ rotation.T, quaternion, columns[..., 7:]], axis=-1)


def representatives():
    """The 24 rotations that permute and flip axes, as (quaternion, permutation of the scales)."""
    found = []
    for permutation in itertools.permutations(range(3)):
        for signs in itertools.product((1, -1), repeat=3):
            matrix = np.zeros((3, 3))
            matrix[permutation, range(3)] = signs
            if np.linalg.det(matrix) > 0:
                found.append((np.asarray(quaternion_from_rotation(jnp.asarray(matrix))), permutation))
    return found


def other_representative(columns, quaternion, permutation):
    """The same ellipsoids by another quaternion: R P with the scales permuted alike."""
    turned = quaternion_multiply(columns[..., 3:7], jnp.broadcast_to(jnp.asarray(quaternion), columns[..., 3:7].shape))
    scale = columns[..., 7:10][..., jnp.array(permutation)]
    return jnp.concatenate([columns[..., :3], turned.astype(columns.dtype), scale, columns[..., 10:]], axis=-1)


def logits_of(model, clips, mask):
    """Logits of any number of clips under one mask: one program for a model and a size of clips."""
    parts = []
    for start in range(0, len(clips), BATCH):
        index = np.minimum(np.arange(start, start + BATCH), len(clips) - 1)
        parts.append(_logits(model, clips[index], jnp.broadcast_to(mask, clips.shape[1:3])))
    return jnp.concatenate(parts)[: len(clips)]


@jax.jit
def _logits(model, clips, mask):
    return jax.vmap(lambda clip: model(clip, mask))(clips)
