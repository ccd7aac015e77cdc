"""Clips as a classifier and its familiarity judge them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from aerojax.classify.base import Classifier, Embedding
from aerojax.classify.familiarity import Familiarity
from aerojax.core.errors import UserError
from aerojax.core.types import CLASSES
from aerojax.data.clips import ClipSet
from aerojax.evaluate.answers import answers_with_features, load_split
from aerojax.evaluate.unknown import JudgedClips, join_judged


def require_features(classifier: Classifier) -> Embedding:
    """The classifier, if it tells what it reads its answers from.

    Raises:
        UserError: it does not.
    """
    if isinstance(classifier, Embedding):
        return classifier
    problem = f"the classifier {classifier.card.name!r} gives no features to tell strange objects by"
    raise UserError("mismatch", problem, "give weights of a member that has step_features, such as views")


def judge_clips(classifier: Embedding, familiarity: Familiarity, clips: ClipSet, group: Sequence[str]) -> JudgedClips:
    """Answer clips, and say how strange they look after their last frame."""
    so_far, features = answers_with_features(classifier, clips)
    log_probabilities, counts = so_far[:, -1], clips.present.sum(axis=1).tolist()
    sets = [familiarity.answer_set(row, count) for row, count in zip(log_probabilities, counts, strict=True)]
    held = np.array([[name in one.classes for name in CLASSES] for one in sets if one is not None])
    last, frames = jnp.asarray(features[:, -1]), jnp.asarray(clips.present.sum(axis=1))
    distance, share = jax.jit(jax.vmap(lambda f, n: (familiarity.distance(f), familiarity.share(f, n))))(last, frames)
    said = log_probabilities, np.asarray(distance), np.asarray(share)
    return JudgedClips(*said, clips.identity, tuple(group), held if len(held) else None)


def judge_folders(
    classifier: Embedding, familiarity: Familiarity, folders: Sequence[Path], split: str, *, frames: int
) -> tuple[JudgedClips, np.ndarray]:
    """Judge one split of several folders; groups are the kinds of outliers, and for the classes the folders.

    Returns:
        What was said, and the clips' labels.

    Raises:
        UserError: a folder has no such clips, or they are broken.
    """
    parts, labels = [], []
    for folder in folders:
        clips = load_split((folder,), split, frames)
        parts.append(
            judge_clips(classifier, familiarity, clips, [str(facts.get("kind", folder.name)) for facts in clips.facts])
        )
        labels.append(clips.label)
    return join_judged(parts), np.concatenate(labels)
