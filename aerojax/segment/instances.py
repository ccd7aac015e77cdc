"""Every instance of the masks that come with the images, for trackers of several objects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from aerojax.capture.format import CaptureCamera
from aerojax.core.types import FrameSet, Silhouette
from aerojax.segment.base import Preview, SegmenterConfig
from aerojax.segment.silhouettes import silhouette_of


@dataclass(frozen=True)
class InstancesConfig(SegmenterConfig):
    """All instances of the capture's masks; cameras without masks see nothing."""

    name: Literal["instances"] = "instances"

    def build(self, object_id: int | None) -> InstancesSegmenter:
        """The member; with an id, only that instance."""
        return InstancesSegmenter(object_id)


@dataclass(frozen=True)
class InstancesSegmenter:
    """One silhouette an instance and camera; it remembers nothing."""

    object_id: int | None

    def initial(self, cameras: Sequence[CaptureCamera], preview: Preview | None = None) -> None:
        """Nothing to remember."""
        return None

    def step(self, frames: FrameSet, state: None) -> tuple[list[Silhouette], None]:
        """Silhouettes of all instances, camera by camera."""
        found = [
            silhouette_of(camera, number, (mask == number).astype(np.float32))
            for camera, mask in enumerate(frames.ids)
            if mask is not None
            for number in np.unique(mask[mask > 0]).tolist()
            if self.object_id in (None, number)
        ]
        return [one for one in found if one is not None], state
