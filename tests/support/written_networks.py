"""The network around an ellipsoid (`support.networks`) as a capture on disk."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from support.networks import frame_sets, network

from aerojax.capture.format import Capture, write_capture_json
from aerojax.capture.write import write_frame


def write_network(
    folder: Path,
    frames: int = 4,
    *,
    cameras: int = 4,
    blind: tuple[int, ...] = (),
    watching: tuple[int, ...] | None = None,
    instance: int = 3,
    world_from_rig: np.ndarray | None = None,
) -> Capture:
    """Write a capture of an instance in `frames` frames; nobody sees it in `blind` ones, or those `watching` alone."""
    made = network(cameras, world_from_rig=world_from_rig)
    shown = frame_sets(network(cameras), range(frames), blind=blind, watching=watching, instance=instance)
    for one in shown:
        for camera, rgb, ids in zip(made, one.rgb, one.ids, strict=True):
            assert rgb is not None
            write_frame(folder, camera, one.frame, rgb.astype(np.float64), ids)
    capture = Capture(folder, 30.0, frames, made, None)
    write_capture_json(capture)
    return capture
