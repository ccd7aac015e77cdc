"""Cameras without images: `capture.json`, or a file with its list of cameras and, for each, a clock of its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from aerojax.capture.format import calibration_to_json
from aerojax.capture.imports.calibration.documents import read_document, rigid
from aerojax.capture.validate.examination import CAMERA_KEYS, OPTIONAL_IMAGES, check_cameras
from aerojax.capture.validate.findings import Findings, refuse
from aerojax.core.errors import UserError
from aerojax.core.files import write_json
from aerojax.track.sights import TimedCamera

CLOCK = ("time_offset_s", "clock_rate", "line_delay_s", "fps")
_REQUIRED = tuple(key for key in CAMERA_KEYS if key != "rgb")
_FASTEST, _SLOWEST = 1.1, 0.9
"""Beyond them a clock's rate is a mistake."""
_LONGEST_LINE_S = 0.01


@dataclass(frozen=True, eq=False)
class CameraFile:
    """cameras: of the network. fps: images a second of each, by name, where the file says it."""

    cameras: tuple[TimedCamera, ...]
    fps: dict[str, float]


def read_cameras(path: Path) -> CameraFile:
    """Read cameras.

    Args:
        path: of `capture.json`, or of a JSON or YAML file with `cameras`, a list as there; `rgb` is not needed, and
            `clock_rate`, `line_delay_s` and `fps` may stand beside `time_offset_s`. An `fps` beside the list is that
            of all cameras. A folder is that of a capture.

    Raises:
        UserError: lists every problem at once, each with field and remedy.
    """
    path = path / "capture.json" if path.is_dir() else path
    raw = read_document(path)
    findings = Findings(path.name)
    if not isinstance(raw, dict) or not isinstance(raw.get("cameras"), list):
        raise UserError("invalid", f"{path}: has no list `cameras`", "write it as in capture.json")
    check_cameras(raw["cameras"], findings, _REQUIRED, ("rgb", *OPTIONAL_IMAGES, "mask_kind", *CLOCK))
    for index, camera in enumerate(raw["cameras"]):
        if isinstance(camera, dict):
            _check_clock(camera, f"cameras[{index}]", findings)
    refuse(findings.problems, f"cameras of {path}")
    cameras = tuple(_camera(one, str(path)) for one in raw["cameras"])
    given = {one["name"]: one.get("fps", raw.get("fps")) for one in raw["cameras"]}
    return CameraFile(cameras, {name: float(fps) for name, fps in given.items() if fps is not None})


def _check_clock(camera: dict[str, Any], field: str, findings: Findings) -> None:
    values = {key: findings.number(camera[key], f"{field}.{key}") for key in CLOCK if key in camera}
    rate, line, fps = (values.get(key) for key in ("clock_rate", "line_delay_s", "fps"))
    if rate is not None and not _SLOWEST < rate < _FASTEST:
        remedy = "write seconds of the network in one second of the camera's clock, about 1"
        findings.add(f"{field}.clock_rate", f"{rate:g} is no clock's rate", remedy)
    if line is not None and abs(line) > _LONGEST_LINE_S:
        findings.add(f"{field}.line_delay_s", f"{line:g} s a row is too long", "write seconds from row to row")
    if fps is not None and fps <= 0:
        findings.add(f"{field}.fps", f"must be positive, is {fps:g}", "write images a second")


def _camera(raw: dict[str, Any], where: str) -> TimedCamera:
    return TimedCamera(
        name=raw["name"],
        width=raw["width"],
        height=raw["height"],
        K=np.array(raw["K"], np.float64),
        distortion_model=raw["distortion"]["model"],
        distortion=tuple(float(c) for c in raw["distortion"]["coefficients"]),
        world_from_cam=rigid(np.array(raw["world_from_cam"], np.float64), f"{where}: {raw['name']}"),
        time_offset_s=float(raw.get("time_offset_s", 0.0)),
        clock_rate=float(raw.get("clock_rate", 1.0)),
        line_delay_s=float(raw.get("line_delay_s", 0.0)),
    )


def write_cameras(path: Path, cameras: Sequence[TimedCamera]) -> None:
    """Write cameras so that `read_cameras` gives the same back."""
    write_json(path, {"cameras": [_to_json(camera) for camera in cameras]})


def _to_json(camera: TimedCamera) -> dict[str, Any]:
    clock = {key: getattr(camera, key) for key in CLOCK if key != "fps"}
    return {**calibration_to_json(camera), **clock}
