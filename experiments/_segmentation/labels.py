"""What an object is taken for by silhouettes that are at hand: those that were found, and those that were given."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import jax
import numpy as np
from jaxtyping import Float32

from aerojax.capture.format import CaptureCamera
from aerojax.classify.base import Classifier
from aerojax.core.types import CLASSES, FrameSet, Silhouette
from aerojax.pipeline.config import PipelineConfig
from aerojax.pipeline.events import Updated
from aerojax.pipeline.step import make_pipeline
from aerojax.segment.base import Preview


@dataclass(frozen=True)
class Handed:
    """A segmenter that says what it is handed: the state is the next frame's silhouettes."""

    def initial(self, cameras: Sequence[CaptureCamera], preview: Preview | None = None) -> list[Silhouette]:
        """None."""
        return []

    def step(self, frames: FrameSet, state: list[Silhouette]) -> tuple[list[Silhouette], list[Silhouette]]:
        """What was handed, and nothing for the next frame."""
        return state, []


class Labelled:
    """The answer of a pipeline that is handed silhouettes frame by frame."""

    def __init__(
        self, cameras: Sequence[CaptureCamera], config: PipelineConfig, classifier: Classifier, *, seed: int
    ) -> None:
        """Nothing handed yet.

        Args:
            cameras: of the capture. config: its segmenter is left out. classifier: a causal one.
            seed: of the decimation.
        """
        made = make_pipeline(cameras, config, classifier, key=jax.random.key(seed))
        self._pipeline = replace(made, segmenter=Handed())
        self._state = self._pipeline.initial()
        self._frames: Counter[int] = Counter()
        self._last: dict[int, Float32[np.ndarray, "label"]] = {}

    def hand(self, frames: FrameSet, silhouettes: Sequence[Silhouette]) -> None:
        """One more frame."""
        events, self._state = self._pipeline.step(frames, replace(self._state, segment=list(silhouettes)))
        for event in events:
            if isinstance(event, Updated) and event.log_probabilities is not None:
                self._frames[event.track] += 1
                self._last[event.track] = event.log_probabilities

    @property
    def label(self) -> str | None:
        """Of the object that was used in most frames; None if none was."""
        if not self._frames:
            return None
        return CLASSES[int(np.argmax(self._last[self._frames.most_common(1)[0][0]]))]


def label_figures(rows: Sequence[Mapping[str, Any]]) -> dict[str, int]:
    """Captures, how many are labelled, and how many of the labels are right, by found masks and by given ones."""
    figures = {"captures": len(rows)}
    for name in ("found", "given"):
        labels = [(row[f"label_{name}"], row["true"]) for row in rows]
        figures[f"labelled_{name}"] = sum(label is not None for label, _ in labels)
        figures[f"right_{name}"] = sum(label == true for label, true in labels)
    return figures
