"""The format by what a file or folder looks like."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from aerojax.capture.imports.calibration.base import Calibration, CalibrationConfig
from aerojax.capture.imports.calibration.colmap import ColmapConfig
from aerojax.capture.imports.calibration.documents import files_in, read_document
from aerojax.capture.imports.calibration.drone_tracking import INPUTS, DroneTrackingConfig
from aerojax.capture.imports.calibration.kalibr import KalibrConfig
from aerojax.capture.imports.calibration.nerfstudio import NerfstudioConfig
from aerojax.capture.imports.calibration.opencv import OpencvConfig
from aerojax.capture.imports.calibration.projections import ProjectionsConfig
from aerojax.capture.imports.calibration.ros import RosConfig, is_bag


@dataclass(frozen=True)
class AutoCalibrationConfig(CalibrationConfig):
    """The default: each format shows itself by its files and keys; what is none of the others is OpenCV's."""

    name: Literal["auto"] = "auto"

    def read(self, source: Path) -> Calibration:
        """Read by the member that fits, with its defaults."""
        return recognise(source).read(source)


def recognise(source: Path) -> CalibrationConfig:
    """The member that reads `source`, with its defaults.

    Raises:
        UserError: there is no file that could be a calibration.
    """
    folder = source if source.is_dir() else source.parent
    if is_bag(source):
        return RosConfig()
    if source.name in ("images.txt", "images.bin", "cameras.txt", "cameras.bin") or (
        source.is_dir() and any((folder / f"images{suffix}").is_file() for suffix in (".txt", ".bin"))
    ):
        return ColmapConfig()
    if source.is_dir() and (folder / "camInfo").is_dir():
        return ProjectionsConfig()
    if source.is_dir() and (folder / "transforms.json").is_file():
        return NerfstudioConfig()
    document = read_document(files_in(source)[0])
    return _by_keys(document if isinstance(document, Mapping) else {})


def _by_keys(document: Mapping[str, Any]) -> CalibrationConfig:
    if INPUTS in document:
        return DroneTrackingConfig()
    if "frames" in document:
        return NerfstudioConfig()
    if any(str(key).startswith("projectionMatrix_3x4") for key in document):
        return ProjectionsConfig()
    first = document.get("cam0")
    if isinstance(first, Mapping) and "camera_model" in first:
        return KalibrConfig()
    return OpencvConfig()
