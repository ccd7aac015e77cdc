"""Object masks that come with the images."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Integer

from aerojax.capture.format import CaptureCamera
from aerojax.core.errors import UserError
from aerojax.core.types import FrameSet, Silhouette
from aerojax.segment.base import Preview, SegmenterConfig
from aerojax.segment.silhouettes import silhouette_of

PREVIEWED = 5
"""Frames of a preview whose masks choose the object."""


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
        """The instance that covers most pixels of the preview's masks, or the given one if they show it.

        Raises:
            UserError: the preview's masks are empty, or lack the given instance.
        """
        if preview is None:
            return self.object_id
        frames = preview(PREVIEWED, rgb=False, ids=True)
        return choose_object((mask for f in frames for mask in f.ids if mask is not None), self.object_id)

    def step(self, frames: FrameSet, state: int | None) -> tuple[list[Silhouette], int | None]:
        """The instance's silhouettes; without a preview, the largest instance of the first masks is followed."""
        masks = [mask for mask in frames.ids if mask is not None]
        if state is None and any(mask.any() for mask in masks):
            state = choose_object(masks, None)
        found = [
            silhouette_of(camera, state, (mask == state).astype(np.float32))
            for camera, mask in enumerate(frames.ids)
            if mask is not None and state is not None
        ]
        return [one for one in found if one is not None], state


def choose_object(masks: Iterable[Integer[np.ndarray, "height width"]], object_id: int | None) -> int:
    """The instance to follow: the given one, or the one that covers most pixels in these masks.

    Raises:
        UserError: if the given instance appears in none of them, or there is no instance at all.
    """
    totals = np.zeros(1, np.int64)
    for mask in masks:
        counts = np.bincount(mask.ravel(), minlength=len(totals))
        if object_id is not None and 0 < object_id < len(counts) and counts[object_id]:
            return object_id
        counts[: len(totals)] += totals
        totals = counts
    totals[0] = 0
    if object_id is None:
        if not totals.any():
            raise UserError(
                "object-absent",
                "object: every mask of the capture is empty",
                "check the masks, or leave them out of the capture",
            )
        return int(np.argmax(totals))
    present = ", ".join(str(i) for i in np.flatnonzero(totals)) or "none"
    raise UserError("object-absent", f"object={object_id} appears in no mask of the capture", f"present: {present}")
