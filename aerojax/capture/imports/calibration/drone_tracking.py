"""The layout of the public multi-camera drone data sets of Albl, Li and others (github: drone-tracking-datasets).

`config_*.json` names, under "necessary inputs", a detections file (`u v frame` a line) and a camera file (K-matrix,
distCoeff, fps, resolution) for each camera, and `corresponding_frames`: the frame number of each camera at one common
instant. Under "optional inputs" stands the drone's own track (`x y z` a line, metres, east north up) and its rate.
Poses are not part of it, so each camera is resected from the detections and that track.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from jaxtyping import Float64

from aerojax.capture.imports.calibration.base import CalibratedCamera, Calibration, CalibrationConfig
from aerojax.capture.imports.calibration.documents import (
    files_in,
    mapping,
    needed,
    number,
    numbers,
    read_document,
    read_text,
)
from aerojax.capture.imports.calibration.opencv import frame_rate, lens_of
from aerojax.capture.imports.calibration.resection import Sightings, Track, resect
from aerojax.core.errors import UserError

INPUTS = "necessary inputs"


@dataclass(frozen=True, eq=False)
class Recorded:
    """A recording in this layout, one entry a camera.

    seen: where and when it saw the drone; seconds since the common instant.
    lenses: keyword arguments of `CalibratedCamera`. rates: images a second. starts: its frame at the common instant.
    """

    path: Path
    document: Mapping[str, Any]
    seen: tuple[Sightings, ...]
    lenses: tuple[dict[str, Any], ...]
    rates: tuple[float, ...]
    starts: tuple[float, ...]


@dataclass(frozen=True)
class DroneTrackingConfig(CalibrationConfig):
    """A `config_*.json`, or the folder that holds one.

    pixel_centre: where the files have the centre of the top-left pixel.
    delay_s: when the track begins, seconds after the common instant; searched for if None.
    """

    name: Literal["drone_tracking"] = "drone_tracking"
    pixel_centre: float = 0.0
    delay_s: float | None = None

    def read(self, source: Path) -> Calibration:
        """Cameras named by their detections' files, in the order of the configuration."""
        recorded = self.recorded(source)
        seen, rates, starts = recorded.seen, recorded.rates, recorded.starts
        found = resect(seen, _track(recorded.document, recorded.path), self.delay_s)
        # A camera whose common frame is negative began after the common instant; the earliest one is the clock's zero.
        late = [-float(start) / rate for start, rate in zip(starts, rates, strict=True)]
        cameras = tuple(
            CalibratedCamera(
                name=one.name,
                world_from_cam=found.world_from_cam[one.name],
                fps=rate,
                time_offset_s=late_s - min(late),
                **lens,
            )
            for one, lens, rate, late_s in zip(seen, recorded.lenses, rates, late, strict=True)
        )
        errors = ", ".join(f"{name} {error:.1f}" for name, error in found.error_px.items())
        note = f"poses come from the drone's track, which begins at {found.delay_s:.3f} s; median pixels off: {errors}"
        return Calibration(cameras, notes=(note,))

    def recorded(self, source: Path) -> Recorded:
        """What the cameras saw, without their poses.

        Raises:
            UserError: names the file and what is wrong with it.
        """
        path = files_in(source, (".json",))[0]
        document = mapping(read_document(path), str(path))
        inputs = mapping(document.get(INPUTS), f"{path}: {INPUTS}")
        detections, files = (_paths(inputs, key, path) for key in ("path_detections", "path_cameras"))
        starts = numbers(needed(inputs, ("corresponding_frames",), str(path))[1], f"{path}: corresponding_frames")
        if not len(detections) == len(files) == len(starts):
            raise UserError(
                "mismatch", f"{path}: lists of {INPUTS} differ in length", "name each camera in all of them"
            )
        documents = [mapping(read_document(file), str(file)) for file in files]
        lenses = [lens_of(one, str(file), self.pixel_centre) for one, file in zip(documents, files, strict=True)]
        rates = [frame_rate(one, str(file)) or 30.0 for one, file in zip(documents, files, strict=True)]
        seen = [
            self._sightings(file, lens, rate, float(start))
            for file, lens, rate, start in zip(detections, lenses, rates, starts, strict=True)
        ]
        return Recorded(path, document, tuple(seen), tuple(lenses), tuple(rates), tuple(starts.tolist()))

    def _sightings(self, path: Path, lens: dict[str, Any], rate: float, start: float) -> Sightings:
        rows = _table(path)
        rows = rows[np.argsort(rows[:, 2], kind="stable")]
        seen = rows[(rows[:, 0] != 0) | (rows[:, 1] != 0)]  # 0 0 is written where nothing was found
        if len(seen) < 1:
            raise UserError("missing", f"{path}: holds no detection", "give the camera's detections")
        pixels = seen[:, :2] + 0.5 - self.pixel_centre
        time_s = (seen[:, 2] - start) / rate
        return Sightings(path.stem, time_s, pixels, lens["K"], lens["distortion_model"], lens["distortion"])


def _paths(inputs: Mapping[str, Any], key: str, path: Path) -> list[Path]:
    listed = needed(inputs, (key,), str(path))[1]
    if not isinstance(listed, list) or not all(isinstance(one, str) for one in listed):
        raise UserError("invalid", f"{path}: {key} must be a list of paths", "correct it")
    return [path.parent / one for one in listed]


def _table(path: Path) -> Float64[np.ndarray, "row 3"]:
    lines = [line.split() for line in read_text(path).splitlines() if line.strip() and not line.startswith("#")]
    short = next((line for line in lines if len(line) < 3), None)
    if short is not None:
        raise UserError(
            "invalid", f"{path}: a line has {len(short)} of 3 numbers: {' '.join(short)[:60]!r}", "correct it"
        )
    return numbers([line[:3] for line in lines], f"{path}").reshape(-1, 3)


def _track(document: Mapping[str, Any], path: Path) -> Track:
    optional = mapping(document.get("optional inputs"), f"{path}: optional inputs")
    truth = mapping(optional.get("ground_truth"), f"{path}: ground_truth")
    file = path.parent / str(needed(truth, ("filepath",), f"{path}: ground_truth")[1])
    return Track(_table(file), number(needed(truth, ("frequency",), f"{path}: ground_truth")[1], f"{path}: frequency"))
