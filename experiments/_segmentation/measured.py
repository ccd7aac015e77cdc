"""Figures of one capture: masks that are found without masks beside its own, and the labels by both."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any

import numpy as np

from aerojax.capture.format import Capture
from aerojax.classify.base import Classifier
from aerojax.core.seeds import seed_of
from aerojax.core.types import FrameSet
from aerojax.evaluate.clutter import Clutter, ClutterConfig, cluttered
from aerojax.evaluate.segmentation import frame_score, segmentation_figures
from aerojax.pipeline.config import PipelineConfig
from aerojax.pipeline.source import capture_preview
from aerojax.segment.base import SegmenterConfig
from aerojax.segment.given import GivenConfig
from experiments._segmentation.labels import Labelled


@dataclass(frozen=True)
class Classifying:
    """With what silhouettes are classified."""

    pipeline: PipelineConfig
    classifier: Classifier


@dataclass(frozen=True, eq=False)
class Shown:
    """A capture as cameras see it with clutter in the way, or as it is."""

    capture: Capture
    clutter: Sequence[Clutter]

    @staticmethod
    def of(capture: Capture, clutter: ClutterConfig | None, seed: int) -> Shown:
        """With clutter of each camera's own."""
        sizes = [(c.name, c.width, c.height) for c in capture.cameras if clutter is not None]
        made = [Clutter(w, h, seed=seed_of(seed, name), config=clutter or ClutterConfig()) for name, w, h in sizes]
        return Shown(capture, made)

    def __call__(self, count: int, *, rgb: bool, ids: bool) -> Iterator[FrameSet]:
        """At most so many frames, spread evenly; see `Preview`."""
        frames = capture_preview(self.capture)(count, rgb=rgb, ids=ids or bool(self.clutter))
        return (cluttered(one, self.clutter) if self.clutter else one for one in frames)


def measured(shown: Shown, segment: SegmenterConfig, classifying: Classifying | None, *, seed: int) -> dict[str, Any]:
    """Figures of one capture.

    Args:
        shown: the capture with masks.
        segment: the segmenter, which does not see them.
        classifying: to compare labels, too.
        seed: of the decimation.
    """
    capture = shown.capture
    segmenter, given = segment.build(None), GivenConfig().build(None)
    # Without a preview the masks may also show nothing from first to last, as behind trees.
    state, known = segmenter.initial(capture.cameras, shown), given.initial(capture.cameras, None)
    labelled: dict[str, Labelled] = {}
    if classifying is not None:
        made = capture.cameras, classifying.pipeline, classifying.classifier
        labelled = {name: Labelled(*made, seed=seed) for name in ("found", "given")}
    scores, seconds = [], []
    for frames in shown(capture.frames, rgb=True, ids=True):
        start = perf_counter()
        found, state = segmenter.step(frames, state)
        seconds.append(perf_counter() - start)
        scores.append(frame_score(frames, found))
        if labelled:
            own, known = given.step(frames, known)
            labelled["found"].hand(frames, found)
            labelled["given"].hand(frames, own)
    labels = {f"label_{name}": one.label for name, one in labelled.items()}
    if labelled:
        labels["true"] = capture.true_class(None)
    return {**segmentation_figures(scores), "step_ms": 1000 * float(np.median(seconds)), **labels}


def some_cameras(capture: Capture, cameras: int, frames: int) -> Capture:
    """With so many cameras, spread evenly, and so many frames from the first; 0 takes all."""
    chosen = np.unique(
        np.linspace(0, len(capture.cameras), cameras or len(capture.cameras), endpoint=False).astype(int)
    )
    kept = tuple(capture.cameras[index] for index in chosen)
    return replace(capture, cameras=kept, frames=min(frames or capture.frames, capture.frames))
