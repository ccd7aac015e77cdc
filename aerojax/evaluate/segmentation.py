"""How well objects were found without masks, against masks: overlap, what was missed, and ghosts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Integer
from scipy.optimize import linear_sum_assignment

from aerojax.core.types import FrameSet, Silhouette
from aerojax.geometry.boxes import tight_box

LEAST_SPAN = 20.0
"""Pixels along the longer side of an object's box, from which on an image of it counts."""


@dataclass(frozen=True)
class FrameScore:
    """One frame.

    overlaps: intersection over union of every image of every object that counts, 0 where it was not found.
    ghosts: numbers of the segmenter that touch no object in any camera.
    numbers: of the segmenter, by the object's true id.
    """

    overlaps: tuple[float, ...]
    ghosts: int
    numbers: dict[int, int]


def frame_score(frames: FrameSet, found: Sequence[Silhouette], *, least_span: float = LEAST_SPAN) -> FrameScore:
    """Compare silhouettes with the masks that came with the images.

    The segmenter's objects are paired with the masks' so that most pixels of all cameras agree; pixels that it covers
    by more than half are its.

    Args:
        frames: with masks; cameras without any do not count.
        found: silhouettes of all objects.
        least_span: see `LEAST_SPAN`.
    """
    true = sorted({int(i) for ids in frames.ids if ids is not None for i in np.unique(ids[ids > 0])})
    numbers = sorted({one.object_id for one in found})
    masks = {(one.camera, one.object_id): one.coverage > 0.5 for one in found}
    common = np.zeros((len(true), len(numbers)))
    for (camera, number), mask in masks.items():
        ids = frames.ids[camera]
        if ids is not None:
            counts = np.bincount(ids[mask], minlength=max(true, default=0) + 1)
            common[:, numbers.index(number)] += [counts[one] for one in true]
    rows, columns = linear_sum_assignment(-common)
    paired = {true[r]: numbers[c] for r, c in zip(rows, columns, strict=True) if common[r, c] > 0}
    overlaps = [
        _overlap(ids, one, masks.get((camera, paired.get(one, -1))))
        for camera, ids in enumerate(frames.ids)
        if ids is not None
        for one in true
        if _span(ids == one) >= least_span
    ]
    return FrameScore(tuple(overlaps), int(np.count_nonzero(common.sum(axis=0) == 0)), paired)


def _span(mask: Bool[np.ndarray, "height width"]) -> float:
    box = tight_box(mask)
    return 0.0 if box is None else max(box[2] - box[0], box[3] - box[1])


def _overlap(
    ids: Integer[np.ndarray, "height width"], one: int, mask: Bool[np.ndarray, "height width"] | None
) -> float:
    if mask is None:
        return 0.0
    true = ids == one
    return float(np.count_nonzero(true & mask) / np.count_nonzero(true | mask))


def segmentation_figures(scores: Iterable[FrameScore]) -> dict[str, float | int | None]:
    """JSON-ready: frames, images, median overlap and its tenth percentile, share missed, ghosts in 100 frames, numbers.

    `numbers` are changes of an object's number from one frame to the next in which it was found.
    """
    scores = list(scores)
    overlaps = np.array([value for score in scores for value in score.overlaps])
    last: dict[int, int] = {}
    changes = 0
    for score in scores:
        changes += sum(last.get(one, number) != number for one, number in score.numbers.items())
        last |= score.numbers
    return {
        "frames": len(scores),
        "images": len(overlaps),
        "median_iou": float(np.median(overlaps)) if len(overlaps) else None,
        "iou_10": float(np.quantile(overlaps, 0.1)) if len(overlaps) else None,
        "missed": float(np.mean(overlaps == 0)) if len(overlaps) else None,
        "ghosts_in_100": 100 * sum(score.ghosts for score in scores) / max(len(scores), 1),
        "number_changes": changes,
    }


def segmentation_table(rows: Sequence[Mapping[str, Any]]) -> str:
    """A Markdown table of `segmentation_figures`, with the capture, its cameras, how many agree, and milliseconds."""
    lines = [
        "| capture | cameras | agree | IoU | 10 % | missed | ghosts/100 | ms |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        iou, low, missed = (
            "-" if row[key] is None else f"{row[key]:.2f}" for key in ("median_iou", "iou_10", "missed")
        )
        cells = [row["capture"], row["cameras"], row["views"] or "rule", iou, low, missed]
        cells += [f"{row['ghosts_in_100']:.1f}", f"{row['step_ms']:.0f}"]
        lines.append(f"| {' | '.join(map(str, cells))} |")
    return "\n".join(lines)
