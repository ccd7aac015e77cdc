"""Object masks that come with the images."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float32, Integer

from aerojax.capture.format import CaptureCamera
from aerojax.core.errors import UserError
from aerojax.core.types import FrameSet, Silhouette
from aerojax.segment.base import Preview, SegmenterConfig
from aerojax.segment.silhouettes import silhouette_of

PREVIEWED = 5
"""Frames of a preview whose masks choose the object; four times as many, and so on, as long as they do not show it."""


@dataclass(frozen=True)
class GivenConfig(SegmenterConfig):
    """Masks of the capture; cameras without masks see nothing."""

    name: Literal["given"] = "given"

    def build(self, object_id: int | None) -> GivenSegmenter:
        """The member that follows this instance."""
        return GivenSegmenter(object_id)


@dataclass(frozen=True)
class GivenSegmenter:
    """One instance of the masks; its state is the instance that it follows, None until it has met one."""

    object_id: int | None

    def initial(self, cameras: Sequence[CaptureCamera], preview: Preview | None = None) -> int | None:
        """The instance that covers most pixels of some of the preview's masks, or the given one if they show it.

        Where a few frames do not, more are looked at, and in the end all: an object may be seen briefly.

        Raises:
            UserError: all of the preview's masks are empty, or lack the given instance.
        """
        if preview is None:
            return self.object_id
        asked = PREVIEWED
        while True:
            areas, frames = _areas(preview(asked, rgb=False, ids=True))
            if frames < asked or _shows(areas, self.object_id):
                return _choose(areas, self.object_id)
            asked *= 4

    def step(self, frames: FrameSet, state: int | None) -> tuple[list[Silhouette], int | None]:
        """The instance's silhouettes; without a preview, the largest instance of the first masks is followed."""
        masks = [mask for mask in frames.ids if mask is not None]
        if state is None and any(mask.any() for mask in masks):
            state = choose_object(masks, None)
        found = [
            silhouette_of(camera, state, _coverage(frames, camera, mask, state))
            for camera, mask in enumerate(frames.ids)
            if mask is not None and state is not None
        ]
        return [one for one in found if one is not None], state


def _coverage(
    frames: FrameSet, camera: int, mask: Integer[np.ndarray, "height width"], object_id: int
) -> Float32[np.ndarray, "height width"]:
    """Share of each pixel that the instance covers; shades of a picture are of the one object that it shows."""
    shades = frames.coverage[camera] if frames.coverage else None
    return (mask == object_id).astype(np.float32) if shades is None or object_id != 1 else shades


def choose_object(masks: Iterable[Integer[np.ndarray, "height width"]], object_id: int | None) -> int:
    """The instance to follow: the given one, or the one that covers most pixels in these masks.

    Raises:
        UserError: if the given instance appears in none of them, or there is no instance at all.
    """
    return _choose(_total(masks, np.zeros(1, np.int64)), object_id)


Areas = Integer[np.ndarray, "_"]
"""Pixels of each instance; of the background, instance 0, there are none."""


def _areas(frames: Iterable[FrameSet]) -> tuple[Areas, int]:
    """Areas in all masks of these frames, and how many frames there were."""
    totals, count = np.zeros(1, np.int64), 0
    for one in frames:
        totals = _total((mask for mask in one.ids if mask is not None), totals)
        count += 1
    return totals, count


def _total(masks: Iterable[Integer[np.ndarray, "height width"]], totals: Areas) -> Areas:
    for mask in masks:
        counts = np.bincount(mask.ravel(), minlength=len(totals))
        counts[: len(totals)] += totals
        counts[0] = 0
        totals = counts
    return totals


def _shows(areas: Areas, object_id: int | None) -> bool:
    if object_id is None:
        return bool(areas.any())
    return 0 < object_id < len(areas) and bool(areas[object_id])


def _choose(areas: Areas, object_id: int | None) -> int:
    if _shows(areas, object_id):
        return int(np.argmax(areas)) if object_id is None else object_id
    if object_id is None:
        raise UserError(
            "object-absent",
            "object: every mask of the capture is empty",
            "check the masks, or leave them out of the capture",
        )
    present = ", ".join(str(i) for i in np.flatnonzero(areas)) or "none"
    raise UserError("object-absent", f"object={object_id} appears in no mask of the capture", f"present: {present}")
