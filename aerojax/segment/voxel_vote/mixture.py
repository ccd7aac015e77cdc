"""OpenCV's mixture of Gaussians (MOG2, Zivkovic 2004) beside the running model: what it calls background has no weight.

OpenCV keeps its mixture to itself: it can be neither copied nor stored. A state that holds one goes on from where it
stands and nowhere else, which is refused instead of giving another answer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from jaxtyping import Bool, UInt8

Image = UInt8[np.ndarray, "height width 3"]

FOREGROUND = 255
"""OpenCV's value of a pixel that fits no Gaussian of the background; 127 is a shadow."""


class _Subtractor:
    """OpenCV's object, and how often it has learnt."""

    def __init__(self, history: int) -> None:
        self.mixture: Any = cv2.createBackgroundSubtractorMOG2(history=history, detectShadows=True)
        self.learnt = 0


@dataclass(frozen=True, eq=False)
class Mixture:
    """A mixture of each pixel at one moment. learnt: images that it has learnt from."""

    subtractor: _Subtractor
    learnt: int = 0

    def foreground(self, image: Image) -> Bool[np.ndarray, "height width"]:
        """Pixels that are neither background nor shadow; nothing is learnt.

        Raises:
            RuntimeError: the mixture has gone on since.
        """
        return self._applied(image, 0.0) == FOREGROUND

    def after(self, image: Image, rate: float) -> Mixture:
        """The mixture after one more image, of which each pixel counts by `rate`.

        Raises:
            RuntimeError: the mixture has gone on since.
        """
        self._applied(image, rate)
        self.subtractor.learnt += 1
        return Mixture(self.subtractor, self.learnt + 1)

    def _applied(self, image: Image, rate: float) -> UInt8[np.ndarray, "height width"]:
        if self.subtractor.learnt != self.learnt:
            raise RuntimeError(
                "a mixture of OpenCV goes on from its last state only; background.model=running can be kept"
            )
        return self.subtractor.mixture.apply(image, None, rate)


def mixture_of(images: Sequence[Image], still: Image, history: int) -> Mixture:
    """The mixture of a camera's first images, about their median."""
    found = Mixture(_Subtractor(history)).after(still, 1.0)
    for image in images:
        found = found.after(image, 1 / history)
    return found
