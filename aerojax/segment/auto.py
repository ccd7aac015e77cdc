"""Masks of the capture where a camera has them, motion where it has none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

from aerojax.capture.format import CaptureCamera
from aerojax.core.types import FrameSet, Silhouette
from aerojax.segment.base import Preview, SegmenterConfig
from aerojax.segment.given import GivenSegmenter
from aerojax.segment.motion import Background, MotionConfig, MotionSegmenter


@dataclass(frozen=True)
class AutoConfig(SegmenterConfig):
    """The default: what the capture says where it says something.

    motion: of the cameras without masks.
    """

    name: Literal["auto"] = "auto"
    motion: MotionConfig = field(default_factory=MotionConfig)

    def build(self, object_id: int | None) -> AutoSegmenter:
        """The member that follows this instance where there are masks."""
        return AutoSegmenter(GivenSegmenter(object_id), MotionSegmenter(self.motion))


@dataclass(frozen=True)
class AutoState:
    """States of both members; `object_id` is that of `GivenSegmenter`."""

    object_id: int | None
    backgrounds: tuple[Background, ...]


@dataclass(frozen=True)
class AutoSegmenter:
    """Two members, each for its cameras. What motion finds belongs to the object that the masks name."""

    given: GivenSegmenter
    motion: MotionSegmenter

    def initial(self, cameras: Sequence[CaptureCamera], preview: Preview | None = None) -> AutoState:
        """The object from the masks if any camera has them, backgrounds for the cameras that have none."""
        masked = [camera.mask is not None for camera in cameras]
        chosen = self.given.initial(cameras, preview) if any(masked) else None
        if all(masked):
            return AutoState(chosen, (Background(),) * len(cameras))
        return AutoState(chosen, self.motion.initial(cameras, preview))

    def step(self, frames: FrameSet, state: AutoState) -> tuple[list[Silhouette], AutoState]:
        """Silhouettes from the masks, and from motion in the images of cameras that bring none."""
        found, chosen = self.given.step(frames, state.object_id)
        unmasked = tuple(image if mask is None else None for image, mask in zip(frames.rgb, frames.ids, strict=True))
        if all(image is None for image in unmasked):
            return found, replace(state, object_id=chosen)
        moving, backgrounds = self.motion.step(replace(frames, rgb=unmasked), state.backgrounds)
        named = [replace(one, object_id=chosen or one.object_id) for one in moving]
        return [*found, *named], AutoState(chosen, backgrounds)
