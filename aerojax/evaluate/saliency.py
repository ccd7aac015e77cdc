"""Which Gaussians and which frames an answer stands on: gradients, and what happens without those they point at.

Saliency is the norm of a gradient (Simonyan et al. 2014), here of the answer's log-probability; deletion and insertion
(Petsiuk et al. 2018) check it: without what is salient the answer's probability has to fall sooner than without others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from aerojax.classify.base import Classifier, with_card
from aerojax.core.types import Crops, Evidence

SHARES = (0.0, 0.1, 0.25, 0.5, 0.75, 0.9)
"""Of the Gaussians, deleted or kept."""
LONGEST = 32
"""Frames that are explained; deleting one after the other asks the classifier once for each."""


@dataclass(frozen=True, eq=False)
class Saliency:
    """What an answer stands on.

    label: index of the likeliest class. probability: of it.
    gaussians: of every Gaussian, the change of the log-probability if it moves by one radius of the clip; zeros for a
        classifier that reads crops alone.
    frames: of every frame: the root sum of squares of its Gaussians, and of its crops' pixels where those are read.
    """

    label: int
    probability: float
    gaussians: Float[np.ndarray, "time token"]
    frames: Float[np.ndarray, "time"]


def saliency_of(classifier: Classifier, seen: Evidence, valid: Bool[Array, "time"]) -> Saliency:
    """Gradients of the likeliest class' log-probability at the end of a clip.

    Norms of gradients by position, times the clip's root mean square radius: they turn with nothing, so an exactly
    invariant classifier has the same saliency however the clip is turned.

    Args:
        classifier: any member; its token ensembles are left as they are.
        seen: one clip, leading axis time.
        valid: frames that count; the others have no saliency.
    """
    answer = jax.nn.log_softmax(classifier.clip(seen, valid)[-1])
    label = int(jnp.argmax(answer))
    by_place, by_pixel = _gradients(classifier, seen, valid, jnp.int32(label))
    gaussians = np.linalg.norm(np.asarray(by_place, np.float64), axis=-1) * _radius(seen.gaussians.mean, valid)
    squares = np.sum(gaussians**2, axis=1)
    if by_pixel is not None:
        squares = squares + np.sum(np.asarray(by_pixel, np.float64).reshape(len(squares), -1) ** 2, axis=1)
    counts = np.asarray(valid)
    return Saliency(label, float(jnp.exp(answer[label])), gaussians * counts[:, None], np.sqrt(squares) * counts)


@jax.jit
def _gradients(classifier: Classifier, seen: Evidence, valid: Array, label: Int[Array, ""]) -> tuple[Array, Any]:
    """Of the log-probability of a class: by positions, and by the crops' pixels or None."""

    def score(mean: Array, rgba: Any) -> Array:
        crops = None if seen.crops is None else Crops(rgba, seen.crops.valid)
        moved = replace(seen, gaussians=replace(seen.gaussians, mean=mean), crops=crops)
        return jax.nn.log_softmax(classifier.clip(moved, valid)[-1])[label]

    if seen.crops is None:
        return jax.grad(score)(seen.gaussians.mean, None), None
    return jax.grad(score, argnums=(0, 1))(seen.gaussians.mean, seen.crops.rgba)


def _radius(mean: Float[Array, "time token 3"], valid: Bool[Array, "time"]) -> float:
    """Root mean square distance of the Gaussians from their frame's centre, metres."""
    points = np.asarray(mean, np.float64)[np.asarray(valid)]
    return float(np.sqrt(np.mean(np.sum((points - points.mean(axis=1, keepdims=True)) ** 2, axis=-1))))


def without_gaussians(
    seen: Evidence, score: Float[np.ndarray, "time token"], share: float, *, most: bool = True
) -> Evidence:
    """The same clip in which a share of each frame's Gaussians, those of the highest scores, repeat the others.

    Networks take a fixed number of tokens, so what is deleted is replaced by what is left, again and again in order.

    Args:
        seen: one clip.
        score: of every Gaussian.
        share: of them, 0..1; at least one is left.
        most: False deletes those of the lowest scores.
    """
    tokens = score.shape[1]
    left = max(tokens - round(share * tokens), 1)
    order = np.argsort(score if most else -score, axis=1, kind="stable")[:, :left]
    taken = np.take_along_axis(order, np.arange(tokens)[None] % left, axis=1)
    frame = np.arange(len(score))[:, None]
    return replace(seen, gaussians=jax.tree.map(lambda leaf: leaf[frame, taken], seen.gaussians))


def deletion_curve(
    classifier: Classifier,
    seen: Evidence,
    valid: Bool[Array, "time"],
    score: Float[np.ndarray, "time token"],
    label: int,
    *,
    shares: Sequence[float] = SHARES,
    most: bool = True,
) -> Float[np.ndarray, "share"]:
    """Probability of a class without each share of the Gaussians of the highest scores; of the lowest if not `most`.

    What is left of `1 - share` deleted lowest scores is what the insertion curve inserts.
    """
    clips = [without_gaussians(seen, score, share, most=most) for share in shares]
    return np.array([_probability(classifier, clip, valid, label) for clip in clips])


def frame_curve(
    classifier: Classifier, seen: Evidence, valid: Bool[Array, "time"], score: Float[np.ndarray, "time"], label: int
) -> Float[np.ndarray, "deleted"]:
    """Probability of a class without 0, 1, 2 … of the frames of the highest scores; the last frame left is one."""
    count = int(np.sum(valid))
    order = np.argsort(np.where(valid, -score, np.inf), kind="stable")
    found = []
    for deleted in range(count):
        left = np.array(valid)
        left[order[:deleted]] = False
        found.append(_probability(classifier, seen, jnp.asarray(left), label))
    return np.array(found)


@jax.jit
def _probabilities(classifier: Classifier, seen: Evidence, valid: Array) -> Float[Array, "label"]:
    return jax.nn.softmax(classifier.clip(seen, valid)[-1])


def _probability(classifier: Classifier, seen: Evidence, valid: Array, label: int) -> float:
    return float(_probabilities(classifier, seen, valid)[label])


def explanation(classifier: Classifier, clip: Evidence, *, seed: int = 0) -> dict[str, Any]:
    """Saliency of the end of a clip and its check, JSON-ready.

    Args:
        classifier: any member, asked with one subset of tokens, so that the check deletes what is read.
        clip: Gaussians, and crops where the classifier reads any; leading axis time. Of more than `LONGEST` frames the
            last ones are explained.
        seed: of the random scores that the curves are held against.

    Returns:
        `frames` (saliency of each, the last one's at the end) and `without_frames`; `gaussians` (saliency of each in
        each frame) and the curves `deletion`, `insertion` and `random` by `shares`, for a classifier that reads
        Gaussians.
    """
    one, tokens = with_card(classifier, token_ensembles=1), classifier.card.tokens
    last = jax.tree.map(lambda leaf: leaf[-LONGEST:], clip)
    seen = replace(last, gaussians=jax.tree.map(lambda leaf: leaf[:, :tokens], last.gaussians))
    seen = seen if classifier.reads_crops else replace(seen, crops=None)
    valid = jnp.ones(len(seen.gaussians.mean), bool)
    found = saliency_of(one, seen, valid)
    result: dict[str, Any] = {"label": found.label, "probability": found.probability, "frames": found.frames.tolist()}
    result["without_frames"] = frame_curve(one, seen, valid, found.frames, found.label).tolist()
    if found.gaussians.any():
        chance = np.random.default_rng(seed).random(found.gaussians.shape)
        kept = [1.0 - share for share in SHARES]
        scores = {"deletion": (found.gaussians, SHARES, True), "insertion": (found.gaussians, kept, False)}
        scores["random"] = (chance, SHARES, True)
        result |= {
            name: deletion_curve(one, seen, valid, score, found.label, shares=shares, most=most).tolist()
            for name, (score, shares, most) in scores.items()
        }
        result |= {"shares": list(SHARES), "gaussians": found.gaussians.tolist()}
    return result
