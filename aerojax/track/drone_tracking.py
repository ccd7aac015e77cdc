"""Detections of the public multi-camera drone data sets (github: drone-tracking-datasets), with their own clocks."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from aerojax.capture.imports.calibration.documents import read_document
from aerojax.capture.imports.calibration.drone_tracking import INPUTS, DroneTrackingConfig
from aerojax.core.errors import UserError
from aerojax.track.sights import Detections, TimedCamera


def is_drone_tracking(source: Path) -> bool:
    """Whether a file, or the only `config_*.json` of a folder, is such a recording's."""
    files = sorted(source.glob("config_*.json")) if source.is_dir() else [source]
    if len(files) != 1 or files[0].suffix != ".json":
        return False
    try:
        document = read_document(files[0])
    except UserError:
        return False
    return isinstance(document, dict) and INPUTS in document


def read_drone_tracking(
    source: Path, config: DroneTrackingConfig | None = None
) -> tuple[tuple[TimedCamera, ...], Detections]:
    """Cameras, posed by the drone's own track as it is part of the data, and where they saw it.

    Args:
        source: `config_*.json`, or its folder.
        config: how it is read.

    Raises:
        UserError: names the file and what is wrong with it.
    """
    config = config or DroneTrackingConfig()
    calibration, recorded = config.read(source), config.recorded(source)
    cameras = tuple(
        TimedCamera(
            name=one.name,
            width=one.width or round(2 * one.K[0, 2]),
            height=one.height or round(2 * one.K[1, 2]),
            K=one.K,
            distortion_model=one.distortion_model,
            distortion=one.distortion,
            world_from_cam=one.world_from_cam,
            time_offset_s=one.time_offset_s,
        )
        for one in calibration.cameras
    )
    stamps = [
        one.time_s + start / rate
        for one, start, rate in zip(recorded.seen, recorded.starts, recorded.rates, strict=True)
    ]
    counts = [len(stamp) for stamp in stamps]
    detections = Detections(
        np.repeat(np.arange(len(counts)), counts),
        np.concatenate(stamps),
        np.concatenate([one.pixels for one in recorded.seen]),
        np.zeros(sum(counts)),
    )
    return cameras, detections
