"""What a classifier answers to clips: log-probabilities of whole clips, after each of their frames, and of videos."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, UInt8

from aerojax.classify.base import Classifier, Embedding, with_card
from aerojax.core.arrays import AnyArray
from aerojax.core.errors import UserError
from aerojax.core.types import Crops, Evidence, Gaussians
from aerojax.data.clips import ClipSet, clip_files, load_clips
from aerojax.data.windows import Windows
from aerojax.evaluate.labels import label_figures
from aerojax.evaluate.rotations import rotate_clip

LOWEST = float(np.log(1e-12))
"""Log-probabilities count as no less, so that one clip cannot decide the mean likelihood of a set."""
BATCH = 32
"""Clips that are read side by side."""
TEST_ENSEMBLES = 4
"""Disjoint token subsets that the figures of a trained model average over, as the pipeline does."""


def require_clips(folders: tuple[Path, ...], split: str) -> None:
    """Make sure, before hours of training, that there will be something to test with.

    Raises:
        UserError: a folder has no clips of the split.
    """
    for folder in folders:
        if not clip_files(folder / split):
            remedy = "make them with experiments.generate_dataset and reconstruct_dataset, or leave the folder out"
            raise UserError("missing", f"{folder / split} holds no clips (*.npz)", remedy)


def load_split(folders: tuple[Path, ...], split: str, frames: int, *, crops: bool = True) -> ClipSet:
    """The clips of one split of several folders, cut or padded to `frames`, with or without their crops."""
    return load_clips(*(folder / split for folder in folders), frames=frames, crops=crops)


def crops_from_bytes(
    crops: UInt8[AnyArray, "*batch size size 4"], valid: Bool[AnyArray, "*batch"], kind: Any = jnp.float32
) -> Crops:
    """Crops of a `ClipSet` as a classifier reads them."""
    return Crops(jnp.asarray(crops).astype(kind) / 255, jnp.asarray(valid))


def evidence(
    columns: Float[Array, "time token 14"], crops: tuple[UInt8[Array, "time view size size 4"], Array] | None
) -> Evidence:
    """One clip of a `ClipSet` or of `Windows` as a classifier reads it; `crops` are bytes and which views count."""
    return Evidence(Gaussians.from_columns(columns), None if crops is None else crops_from_bytes(*crops))


@jax.jit
def _last_logits(classifier: Classifier, columns: Array, present: Array, crops: Any) -> Float[Array, "clip label"]:
    return jax.vmap(lambda c, valid, views: classifier.clip(evidence(c, views), valid)[-1])(columns, present, crops)


def crops_read(
    classifier: Classifier, clips: ClipSet | Windows
) -> tuple[UInt8[np.ndarray, "clip time view size size 4"], Bool[np.ndarray, "clip time view"]] | None:
    """The crops of clips where the classifier reads any, else None.

    Raises:
        UserError: it reads crops and the clips have none.
    """
    if not classifier.reads_crops:
        return None
    if clips.crops is None or clips.crop_valid is None:
        problem = f"the classifier {classifier.card.name!r} reads crops and the clips have none"
        raise UserError("missing", problem, "make them again with experiments.generate_clips or reconstruct_dataset")
    return clips.crops, clips.crop_valid


def log_probabilities(classifier: Classifier, clips: ClipSet) -> Float[np.ndarray, "clip label"]:
    """Of whole clips, by as many token ensembles as the classifier's card says."""
    last = max(int(np.flatnonzero(clips.present.any(axis=0)).max(initial=0)) + 1, 1)  # no clip has frames behind it
    crops = jax.tree.map(lambda a: a[:, :last], crops_read(classifier, clips))
    parts, arrays = [], (clips.columns[:, :last], clips.present[:, :last], crops)
    for start in range(0, len(clips.label), BATCH):
        index = np.arange(start, start + BATCH) % len(clips.label)  # one shape, one compilation
        parts.append(_last_logits(classifier, *jax.tree.map(lambda a, i=index: jnp.asarray(a[i]), arrays)))
    return np.maximum(np.concatenate(parts)[: len(clips.label)], LOWEST)


@jax.jit
def _features(
    classifier: Embedding, columns: Array, present: Array, crops: Any
) -> tuple[Float[Array, "clip time label"], Float[Array, "clip time row feature"]]:
    def one(columns: Array, present: Array, crops: Any) -> tuple[Array, Array]:
        logits, features = classifier.clip_features(evidence(columns, crops), present)
        return logits, features

    return jax.vmap(one)(columns, present, crops)


def answers_with_features(
    classifier: Embedding, clips: ClipSet
) -> tuple[Float[np.ndarray, "clip time label"], Float[np.ndarray, "clip time row feature"]]:
    """Log-probabilities after each frame, and what they were read from; whole clips by the last of them."""
    crops, parts = crops_read(classifier, clips), []
    for start in range(0, len(clips.label), BATCH):
        index = np.arange(start, start + BATCH) % len(clips.label)  # one shape, one compilation
        given = (clips.columns, clips.present, crops)
        parts.append(_features(classifier, *jax.tree.map(lambda a, i=index: jnp.asarray(a[i]), given)))
    logits, features = (np.concatenate([part[i] for part in parts])[: len(clips.label)] for i in range(2))
    return np.maximum(logits, LOWEST), features


def split_figures(
    classifier: Classifier, folders: tuple[Path, ...], more: tuple[Path, ...], *, split: str, frames: int
) -> dict[str, dict[str, Any]]:
    """Figures of a split of every folder by the folder's name, and of `folders` together as `all`.

    Args:
        classifier: read with `TEST_ENSEMBLES`.
        folders: of clips, each with the split.
        more: further ones, not counted in `all`.
        split: train, val or test.
        frames: clips are cut or padded to so many.
    """
    sets = {folder.name: load_split((folder,), split, frames) for folder in (*folders, *more)}
    classifier = with_card(classifier, token_ensembles=TEST_ENSEMBLES)
    said = {name: (log_probabilities(classifier, clips), clips.label, clips.identity) for name, clips in sets.items()}
    answers, label, identity = zip(*(said[folder.name] for folder in folders), strict=True)
    said["all"] = np.concatenate(answers), np.concatenate(label), sum(identity, ())  # together they are not asked again
    return {
        name: label_figures(answers, label) | {"identities": len(set(identity))}
        for name, (answers, label, identity) in said.items()
    }


@jax.jit
def _prefix_logits(
    classifier: Classifier, columns: Array, present: Array, quaternion: Array, order: Array, crops: Any
) -> Float[Array, "window time label"]:
    def one(clip: tuple[Any, ...]) -> Array:
        columns, present, quaternion, order, crops = clip
        shuffled = jax.tree.map(lambda leaf: leaf[order], (rotate_clip(columns, quaternion), crops))
        return classifier.clip(evidence(*shuffled), present[order])

    return jax.lax.map(one, (columns, present, quaternion, order, crops), batch_size=16)


def prefix_log_probabilities(
    classifier: Classifier,
    windows: Windows,
    quaternion: Float[np.ndarray, "window time 4"],
    *,
    order: Int[np.ndarray, "window time"] | None = None,
) -> Float[np.ndarray, "window time label"]:
    """After each frame of every window, its frames turned and then put into `order`.

    Crops stay as they are: cameras that turn with the world see the same.
    """
    if order is None:
        order = np.tile(np.arange(windows.present.shape[1]), (len(windows.label), 1))
    arrays = windows.columns, windows.present, quaternion.astype(np.float32), order, crops_read(classifier, windows)
    return np.maximum(np.asarray(_prefix_logits(classifier, *jax.tree.map(jnp.asarray, arrays))), LOWEST)


def shuffled_orders(windows: Windows, *, seed: int) -> Int[np.ndarray, "window time"]:
    """A random order of each window's present frames, the absent ones staying last."""
    rng = np.random.default_rng(seed)
    key = rng.random(windows.present.shape) + ~windows.present
    return np.argsort(key, axis=1)


def video_vote(
    logits: Float[Array, "clip label"], video: Int[Array, "clip"], videos: int
) -> Float[Array, "{videos} label"]:
    """Class probabilities of each video: its clips' softmax, averaged (thesis Eq. 5.19).

    Args:
        logits: one row a clip.
        video: index of each clip's video.
        videos: how many there are; one without clips gets zeros.

    Returns:
        Rows that sum to one. `argmax` gives the label; an exact tie goes to the lowest class.
    """
    total = jax.ops.segment_sum(jax.nn.softmax(logits), video, num_segments=videos)
    return total / jnp.maximum(total.sum(axis=1, keepdims=True), 1e-12)


def vote(log_probabilities: Float[np.ndarray, "window label"], windows: Windows) -> Float[np.ndarray, "video label"]:
    """Log-probabilities of each video: the mean of its windows' probabilities."""
    votes = video_vote(jnp.asarray(log_probabilities), jnp.asarray(windows.video), int(windows.video.max()) + 1)
    return np.log(np.maximum(np.asarray(votes), 1e-12))
