"""A detector's answers to test sequences: a vote of all images of each, with or without a tracker."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np

from aerojax.classify.images.detector import Detector, most_certain
from aerojax.classify.images.tracked import BoxTracker, followed
from aerojax.classify.images.votes import cast_labels
from aerojax.core.types import CLASSES
from aerojax.data.frame_images import FrameImages
from aerojax.data.manifest import SequenceEntry
from aerojax.evaluate.groups import AnsweredClips
from aerojax.training.tasks.detection import detect_all, in_box


def spread_sequences(every: Sequence[SequenceEntry], split: str, per_rig: int) -> list[SequenceEntry]:
    """The sequences of a split in the order of rigs and names, `per_rig` of each rig at most, evenly spread; 0: all."""
    chosen = []
    for rig in sorted({one.rig for one in every}):
        of_rig = sorted((one for one in every if (one.rig, one.split) == (rig, split)), key=lambda one: one.name)
        if of_rig:
            spread = np.linspace(0, len(of_rig) - 1, min(per_rig or len(of_rig), len(of_rig)))
            chosen += [of_rig[index] for index in spread.round().astype(int)]
    return chosen


def ask_detector(
    detector: Detector,
    images: FrameImages,
    sequences: Sequence[SequenceEntry],
    *,
    least: float,
    trackers: Callable[[], BoxTracker] | None,
) -> tuple[AnsweredClips, dict[str, float]]:
    """Ask about test images.

    Args:
        detector: trained.
        images: of the sequences; with a tracker all frames of a camera, in order.
        sequences: what they are of.
        least: confidence below which nothing counts as detected.
        trackers: maker of trackers that carry labels over images without a detection; None for none.

    Returns:
        The vote of each sequence, where one without any label is no answer and counts as wrong; and shares of images
        whose object is seen, of those in which it is found (the box's middle in the true box), and found with the right
        class; and of images with a label.
    """
    found = detect_all(detector, most_certain, images)
    label, confidence, known = found.label, found.confidence, found.confidence >= least
    if trackers is not None:
        camera = images.sequence * (images.camera.max() + 1) + images.camera
        newest = images.images[:, -1]
        label, confidence, known = followed(newest, found.box, label, confidence, known, camera=camera, make=trackers)
    voters = map(jnp.asarray, (label.astype(np.int32), confidence, known, images.sequence.astype(np.int32)))
    ballot = cast_labels(*voters, groups=len(sequences), classes=len(CLASSES))
    answers = AnsweredClips(
        np.array([CLASSES.index(one.label) for one in sequences], np.int64),
        tuple(one.identity for one in sequences),
        tuple(_facts(one, images.width_px[images.seen & (images.sequence == i)]) for i, one in enumerate(sequences)),
        np.asarray(ballot.logits(), np.float64),
        np.asarray(ballot.votes.sum(axis=1)) > 0,
    )
    hit = in_box(found.box, images.box) & images.seen
    seen = max(int(images.seen.sum()), 1)
    shares = {
        "seen": images.seen.mean(),
        "found": hit.sum() / seen,
        "found_and_right": np.sum(hit & (found.label == images.label)) / seen,
        "labelled": known.mean(),
    }
    return answers, {name: float(share) for name, share in shares.items()}


def _facts(sequence: SequenceEntry, widths: np.ndarray) -> dict[str, Any]:
    width = {"width_px": float(np.median(widths))} if len(widths) else {}
    return {"rig": sequence.rig, "distance_m": sequence.distance, **width}
