"""Detections of any detector: JSON Lines or CSV, one detection a line, of one camera or of many.

`{"camera": "cam_01", "time_s": 0.0333, "x": 512.4, "y": 300.1}`, or with `"box": [x0, y0, x1, y1]` (ends exclusive)
instead of x and y, or with `"frame": 1` instead of time_s where the camera's fps is known. A CSV file has the same
names in its first line, and x0, y0, x1, y1 for a box. What else is there is left alone. Pixels are those of the stored
image, the centre of the top-left one at (0.5, 0.5); time_s is on the camera's own clock.
"""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from aerojax.capture.imports.calibration.documents import brief
from aerojax.core.errors import UserError
from aerojax.core.files import write_text
from aerojax.track.camera_files import CameraFile
from aerojax.track.sights import Detections, TimedCamera

SUFFIXES = (".jsonl", ".csv")
CORNERS = ("x0", "y0", "x1", "y1")
_LAYOUT = "each needs camera, time_s or frame, and x and y or a box; docs/track.md has examples"


def read_detections(paths: Sequence[Path], known: CameraFile) -> Detections:
    """Read detections of a network.

    Args:
        paths: files, or folders whose `.jsonl` and `.csv` files are read. A file without a column of cameras, named as
            a camera is, holds that camera's.
        known: the cameras.

    Raises:
        UserError: names file and line, and what is wrong there.
    """
    columns: list[tuple[int, float, float, float, float]] = []
    names = {camera.name: index for index, camera in enumerate(known.cameras)}
    for path in _files(paths):
        for line, raw in _rows(path):
            columns.append(_row(raw, f"{path}: line {line}", path.stem, names, known))
    if not columns:
        raise UserError("missing", f"{', '.join(map(str, paths))}: no detection", "give files that hold some")
    table = np.array(columns, np.float64)
    return Detections(table[:, 0].astype(np.int64), table[:, 1], table[:, 2:4], table[:, 4])


def _files(paths: Sequence[Path]) -> list[Path]:
    found: list[Path] = []
    for path in paths:
        inside = sorted(p for p in path.glob("*") if p.suffix in SUFFIXES) if path.is_dir() else [path]
        if not inside:
            raise UserError("missing", f"{path}: no {' or '.join(SUFFIXES)} in this folder", "give detections")
        found += inside
    return found


def _rows(path: Path) -> Iterator[tuple[int, Mapping[str, Any]]]:
    """Lines with their numbers."""
    if path.suffix not in SUFFIXES:
        raise UserError("invalid", f"{path}: is no {' or '.join(SUFFIXES)} file", "convert the detections")
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            if path.suffix == ".csv":
                reader = csv.DictReader(file, skipinitialspace=True)
                for raw in reader:
                    yield reader.line_num, _typed(raw)
            else:
                for number, text in enumerate(file, 1):
                    if text.strip():
                        yield number, _object(text, f"{path}: line {number}")
    except (UnicodeDecodeError, csv.Error) as error:
        raise UserError("unreadable", f"{path}: {error}", "write UTF-8 text") from None
    except OSError as error:
        raise UserError("missing", f"{path}: cannot be read: {error.strerror}", "correct the path") from None


def _object(text: str, where: str) -> Mapping[str, Any]:
    try:
        raw = json.loads(text)
    except (ValueError, RecursionError):
        raise UserError("unreadable", f"{where} is not valid JSON: {brief(text)}", "write one object a line") from None
    if not isinstance(raw, dict):
        raise UserError("invalid", f"{where} is no JSON object: {brief(raw)}", _LAYOUT)
    return raw


def _typed(raw: Mapping[str | None, Any]) -> Mapping[str, Any]:
    """A line of a CSV file as a line of JSON would be; empty cells are absent."""
    values = {key: value for key, value in raw.items() if key is not None and value not in (None, "")}
    if all(corner in values for corner in CORNERS):
        values["box"] = [values.pop(corner) for corner in CORNERS]
    return values


def _row(
    raw: Mapping[str, Any], where: str, stem: str, names: Mapping[str, int], known: CameraFile
) -> tuple[int, float, float, float, float]:
    """Camera, stamp, middle and diagonal."""
    name = str(raw.get("camera", stem))
    if name not in names:
        told = f"camera {brief(name)} is unknown" if "camera" in raw else "has no camera"
        raise UserError("mismatch", f"{where}: {told}", f"cameras are {', '.join(names)}")
    if "time_s" in raw:
        stamp = _number(raw["time_s"], f"{where}: time_s")
    elif "frame" in raw:
        if name not in known.fps:
            raise UserError("missing", f"{where}: has a frame, and the fps of {name} is not known", "write time_s")
        stamp = _number(raw["frame"], f"{where}: frame") / known.fps[name]
    else:
        raise UserError("invalid", f"{where}: has neither time_s nor frame", f"it has {_keys(raw)}; {_LAYOUT}")
    if "box" in raw:
        box = raw["box"]
        if not isinstance(box, list) or len(box) != 4:
            raise UserError("invalid", f"{where}: box is {brief(box)}", "write x0, y0, x1, y1 with exclusive ends")
        x0, y0, x1, y1 = (_number(value, f"{where}: box") for value in box)
        if not (x0 < x1 and y0 < y1):
            raise UserError("invalid", f"{where}: box {brief(box)} is empty", "write x0, y0, x1, y1 with x0 < x1")
        return names[name], stamp, (x0 + x1) / 2, (y0 + y1) / 2, math.hypot(x1 - x0, y1 - y0)
    if "x" in raw and "y" in raw:
        return names[name], stamp, _number(raw["x"], f"{where}: x"), _number(raw["y"], f"{where}: y"), 0.0
    raise UserError("invalid", f"{where}: has neither x and y nor a box", f"it has {_keys(raw)}; {_LAYOUT}")


def _keys(raw: Mapping[str, Any]) -> str:
    return brief(", ".join(raw)) or "nothing"


def _number(value: Any, where: str) -> float:
    try:
        found = math.nan if isinstance(value, bool) else float(value)
    except (TypeError, ValueError, OverflowError):
        found = math.nan
    if not math.isfinite(found):
        raise UserError("invalid", f"{where} must be a finite number, is {brief(value)}", "correct it")
    return found


def write_detections(path: Path, detections: Detections, cameras: Sequence[TimedCamera]) -> None:
    """Write points as JSON Lines; boxes become their middles."""
    lines = [
        json.dumps({"camera": cameras[camera].name, "time_s": stamp, "x": x, "y": y})
        for camera, stamp, (x, y) in zip(
            detections.camera.tolist(), detections.stamp_s.tolist(), detections.pixels.tolist(), strict=True
        )
    ]
    write_text(path, "".join(f"{line}\n" for line in lines))
