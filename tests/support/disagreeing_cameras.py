"""What a network records whose cameras are turned, moved or late without anybody's knowing it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from aerojax.capture.format import CaptureCamera
from aerojax.core.types import FrameSet, Observation
from aerojax.reconstruct.observe import observe
from aerojax.segment.silhouettes import silhouette_of


def turned(cameras: Sequence[CaptureCamera], index: int, degrees: Sequence[float]) -> tuple[CaptureCamera, ...]:
    """The cameras, one stated turned about its own right, down and forward axes."""
    pose = cameras[index].world_from_cam.copy()
    pose[:3, :3] = pose[:3, :3] @ Rotation.from_rotvec(degrees, degrees=True).as_matrix()
    return tuple(replace(c, world_from_cam=pose) if n == index else c for n, c in enumerate(cameras))


def late(frames: Sequence[FrameSet], index: int, count: int) -> list[FrameSet]:
    """The frames, one camera's pictures `count` later than the others'."""

    def mixed(now: tuple, then: tuple) -> tuple:
        return tuple(b if n == index else a for n, (a, b) in enumerate(zip(now, then, strict=True)))

    pairs = zip(frames, frames[count:], strict=False)
    return [replace(a, rgb=mixed(a.rgb, b.rgb), ids=mixed(a.ids, b.ids)) for a, b in pairs]


def observed(frames: FrameSet, cameras: Sequence[CaptureCamera], *, size: int = 64) -> Observation:
    """The crops of one frame, by its masks."""
    covered = [None if ids is None else (ids > 0).astype(np.float32) for ids in frames.ids]
    silhouettes = [None if c is None else silhouette_of(n, 1, c) for n, c in enumerate(covered)]
    return observe(frames, silhouettes, cameras, size=size, world_from_rig=np.eye(4))
