"""Clips of Gaussians on disk and in memory, and how a batch is drawn and varied."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Float32, Int, Key

from aerojax.errors import UserError
from aerojax.types import CLASSES


@dataclass(frozen=True)
class ClipSet:
    """Labelled clips, padded to one length: columns (14 attributes), which frames are real, labels, identities."""

    columns: Float32[np.ndarray, "clip time token 14"]
    present: Bool[np.ndarray, "clip time"]
    label: Int[np.ndarray, "clip"]
    identity: tuple[str, ...]


@dataclass(frozen=True)
class VariationConfig:
    """Training-time variation of a clip.

    frames, tokens: window length and tokens a frame that a batch holds.
    jitter: standard deviation of a token's position over the clip's radius.
    colour: strength of the random recolouring (gain and offset a channel).
    drop: share of a frame's tokens that may repeat others, drawn up to this.
    """

    frames: int = 12
    tokens: int = 128
    jitter: float = 0.01
    colour: float = 0.5
    drop: float = 0.3


def save_clip(path: Path, columns: np.ndarray, label: str, identity: str) -> None:
    """Write one clip as `.npz`, whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(path.name + ".tmp")
    with temporary.open("wb") as file:
        np.savez(file, columns=columns.astype(np.float32), label=np.array(label), identity=np.array(identity))
    temporary.replace(path)


def load_clips(folder: Path, *, frames: int) -> ClipSet:
    """Read every clip of a folder in the order of names, padded with zeros or cut to `frames`.

    Raises:
        UserError: no clips, or one that is broken, of another class or of another size.
    """
    paths = sorted(folder.glob("*.npz"))
    if not paths:
        raise UserError(f"{folder} holds no clips (*.npz); make them with python -m experiments.reconstruct_dataset")
    columns, present, labels, identities = [], [], [], []
    for path in paths:
        clip, label, identity = _load_clip(path)
        clip = clip[:frames]
        if columns and clip.shape[1] != columns[0].shape[1]:
            raise UserError(
                f"{path} has {clip.shape[1]} tokens a frame, others have {columns[0].shape[1]}; make it again"
            )
        padding = frames - len(clip)
        columns.append(np.pad(clip, ((0, padding), (0, 0), (0, 0))))
        present.append(np.arange(frames) < len(clip))
        labels.append(CLASSES.index(label))
        identities.append(identity)
    return ClipSet(np.stack(columns), np.stack(present), np.array(labels), tuple(identities))


def join_clips(sets: Sequence[ClipSet]) -> ClipSet:
    """Several sets of equal length as one, in order.

    Raises:
        UserError: they have different numbers of tokens a frame.
    """
    tokens = {clips.columns.shape[2] for clips in sets}
    if len(tokens) > 1:
        raise UserError(f"sets of clips have {sorted(tokens)} tokens a frame; make them again with one number")
    return ClipSet(
        np.concatenate([clips.columns for clips in sets]),
        np.concatenate([clips.present for clips in sets]),
        np.concatenate([clips.label for clips in sets]),
        tuple(name for clips in sets for name in clips.identity),
    )


def _load_clip(path: Path) -> tuple[Float32[np.ndarray, "time token 14"], str, str]:
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
            clip, label, identity = stored["columns"], str(stored["label"]), str(stored["identity"])
    except (OSError, EOFError, ValueError, KeyError, AttributeError, zipfile.BadZipFile) as error:
        raise UserError(f"{path} cannot be read as a clip ({error}); delete it and make it again") from None
    if label not in CLASSES or clip.ndim != 3 or clip.shape[-1] != 14:
        raise UserError(f"{path} is not a clip of (time, token, 14) with a class of {CLASSES}; make it again")
    return clip.astype(np.float32), label, identity


def epoch_order(count: int, batch: int, *, seed: int, epoch: int) -> Iterator[Int[np.ndarray, "batch"]]:
    """Index batches of one shuffled epoch; the tail that fills no batch is left for another epoch's shuffle."""
    order = np.random.default_rng((seed, epoch)).permutation(count)
    for start in range(0, count - batch + 1, batch):
        yield order[start : start + batch]


def vary_clip(
    columns: Float[Array, "time token 14"],
    present: Bool[Array, "time"],
    config: VariationConfig,
    *,
    key: Key[Array, ""],
) -> tuple[Float[Array, "frames tokens 14"], Bool[Array, "frames tokens"]]:
    """A random window and token subset of a clip, jittered and recoloured.

    Everything commutes with rotation (isotropic jitter, colours apart from geometry), so an invariant model trains the
    same whatever the world's orientation.
    """
    window, tokens, position, gain, offset, count = jax.random.split(key, 6)
    length = jnp.sum(present)
    start = jax.random.randint(window, (), 0, jnp.maximum(length - config.frames + 1, 1))
    index = start + jnp.arange(config.frames)
    real = index < length
    clip = columns[jnp.minimum(index, columns.shape[0] - 1)]
    keep = 1.0 - config.drop * jax.random.uniform(count)
    order = jax.vmap(lambda k: jax.random.permutation(k, columns.shape[1]))(jax.random.split(tokens, config.frames))
    picked = order[:, : config.tokens] % columns.shape[1]
    visible = jnp.arange(config.tokens) < keep * config.tokens
    clip = jnp.take_along_axis(clip, picked[:, :, None], axis=1)
    mean = clip[..., :3]
    centre = jnp.mean(mean, axis=1, keepdims=True)
    radius = jnp.sqrt(jnp.mean(jnp.sum((mean - centre) ** 2, axis=-1)) + 1e-12)
    mean = mean + config.jitter * radius * jax.random.normal(position, mean.shape)
    colour = clip[..., 11:] * (1 + config.colour * jax.random.normal(gain, (3,)))
    colour = colour + config.colour * jax.random.normal(offset, (3,))
    clip = jnp.concatenate([mean, clip[..., 3:11], colour], axis=-1)
    return clip, real[:, None] & visible[None, :]
