"""Masks without annotation: what moves in front of a static camera's background."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import cv2
import numpy as np
from jaxtyping import Float, Float32, Integer

from aerojax.capture.format import CaptureCamera
from aerojax.core.colour import as_bytes, as_floats
from aerojax.core.types import FrameSet, Silhouette
from aerojax.segment.base import Preview, SegmenterConfig
from aerojax.segment.silhouettes import silhouette_of

PREVIEWED = 15
"""Images whose median is the background."""
FEWEST_IMAGES = 5
"""Images without which there is no background: the object may stand in most of fewer."""


@dataclass(frozen=True)
class MotionConfig(SegmenterConfig):
    """The largest thing that moves in each image; masks of the capture are not looked at.

    threshold: least difference from the background of any sRGB channel.
    """

    name: Literal["motion"] = "motion"
    threshold: float = 0.03

    def build(self, object_id: int | None) -> MotionSegmenter:
        """The member; it finds one object, whatever its id."""
        return MotionSegmenter(self)


@dataclass(frozen=True, eq=False)
class Background:
    """What one camera sees where nothing moves: the median of images, kept 8-bit so that memory stays small.

    images: at most `PREVIEWED`, spread evenly over what was seen. period: every so many frames one was kept; seen:
    frames so far. still: their median, None before there are `FEWEST_IMAGES`. fixed: from a preview, never renewed.
    """

    images: tuple[Integer[np.ndarray, "height width 3"], ...] = ()
    period: int = 1
    seen: int = 0
    still: Float32[np.ndarray, "height width 3"] | None = None
    fixed: bool = False

    def after(self, image: Float32[np.ndarray, "height width 3"]) -> Background:
        """The background after one more image: one in `period` is kept, and the period doubles when all are full."""
        if self.fixed or self.seen % self.period:
            return self if self.fixed else replace(self, seen=self.seen + 1)
        images, period = (*self.images, as_bytes(image)), self.period
        if len(images) > PREVIEWED:
            images, period = images[::2], 2 * period
        still = _median(images) if len(images) >= FEWEST_IMAGES else None
        return Background(images, period, self.seen + 1, still)


def _median(images: Sequence[Integer[np.ndarray, "height width 3"]]) -> Float32[np.ndarray, "height width 3"]:
    return background([as_floats(image) for image in images])


@dataclass(frozen=True)
class MotionSegmenter:
    """Differences from each camera's background; the state is one `Background` a camera."""

    config: MotionConfig

    def initial(self, cameras: Sequence[CaptureCamera], preview: Preview | None = None) -> tuple[Background, ...]:
        """Backgrounds from the preview; without one they form as frames pass."""
        if preview is None:
            return (Background(),) * len(cameras)
        seen: list[list[np.ndarray]] = [[] for _ in cameras]
        for frames in preview(PREVIEWED, rgb=True, ids=False):
            for images, image in zip(seen, frames.rgb, strict=True):
                if image is not None:
                    images.append(as_bytes(image))
        return tuple(Background(still=_median(i), fixed=True) if i else Background() for i in seen)

    def step(self, frames: FrameSet, state: tuple[Background, ...]) -> tuple[list[Silhouette], tuple[Background, ...]]:
        """One silhouette a camera at most; none before a camera has a background."""
        state = tuple(b if image is None else b.after(image) for b, image in zip(state, frames.rgb, strict=True))
        found = []
        for camera, (image, known) in enumerate(zip(frames.rgb, state, strict=True)):
            if image is not None and known.still is not None:
                mask = motion_mask(image, known.still, threshold=self.config.threshold)
                found.append(silhouette_of(camera, 1, mask.astype(np.float32)))
        return [one for one in found if one is not None], state


def background(frames: list[Float[np.ndarray, "height width 3"]]) -> Float[np.ndarray, "height width 3"]:
    """Per-pixel median of a camera's frames; right where the object covers a pixel less than half the time."""
    return np.median(np.stack(frames), axis=0).astype(np.float32)


def motion_mask(
    image: Float[np.ndarray, "height width 3"], still: Float[np.ndarray, "height width 3"], *, threshold: float = 0.03
) -> Integer[np.ndarray, "height width"]:
    """The largest connected region that differs from the background: 1 inside, 0 outside.

    Args:
        image, still: sRGB 0..1 of one camera, and its background.
        threshold: least difference of any channel; raised to six times the image's own noise (robust, by the median).
    """
    difference = np.max(np.abs(image - still), axis=-1)
    noise = 1.4826 * float(np.median(difference))
    moving = (cv2.GaussianBlur(difference, (0, 0), 0.6) > max(threshold, 6 * noise)).astype(np.uint8)
    # Join parts that thin arms connect before components are counted, then keep only real pixels of the winner.
    joined = cv2.morphologyEx(moving, cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))
    count, labels, stats, _ = cv2.connectedComponentsWithStats(joined, connectivity=8)
    if count < 2:
        return np.zeros(moving.shape, np.uint16)
    largest = 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
    return _without_halo(((labels == largest) & (moving > 0)).astype(np.uint8), difference).astype(np.uint16)


def _without_halo(
    found: Integer[np.ndarray, "height width"], difference: Float[np.ndarray, "height width"]
) -> Integer[np.ndarray, "height width"]:
    """Drop rim pixels that differ far less than a neighbour does.

    The object covers only part of them: a faint threshold takes in pixels of a tenth's coverage where the contrast is
    strong. Comparing with the neighbourhood asks for about 0.4 whatever the contrast, and keeps rods one pixel wide.
    """
    square = np.ones((3, 3), np.uint8)
    core = cv2.erode(found, square)
    solid = difference > 0.4 * cv2.dilate(difference, square)
    return np.where(solid, found, core)
