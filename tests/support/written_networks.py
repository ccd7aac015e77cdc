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
    world_from_rig: np.ndarray | None = None,
) -> Capture:
    """Write a capture of instance 3 in `frames` frames; nobody sees it in `blind` ones."""
    made = network(cameras, world_from_rig=world_from_rig)
    for one in frame_sets(network(cameras), range(frames), blind=blind):
        for camera, rgb, ids in zip(made, one.rgb, one.ids, strict=True):
            assert rgb is not None
            write_frame(folder, camera, one.frame, rgb.astype(np.float64), ids)
    capture = Capture(folder, 30.0, frames, made, None)
    write_capture_json(capture)
    return capture
