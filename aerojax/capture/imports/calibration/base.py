"""The door of calibration formats: a file or folder of another tool in, cameras in this house's conventions out."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
from jaxtyping import Float64

UPRIGHT_FROM_CAMERA = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
"""A world whose +Y is where a level camera looks (+z) and whose +Z is its -y."""


@dataclass(frozen=True, eq=False)
class CalibratedCamera:
    """One camera as a calibration gives it, with OpenCV axes and the top-left pixel's centre at (0.5, 0.5).

    K: pixels. distortion_model, distortion: as in `CaptureCamera`.
    world_from_cam: rigid but for the unit; in the calibration's world and unit.
    width, height: pixels; None where the format does not hold them.
    files: its images as the calibration names them, in order; empty where it names none.
    masks: of those images, likewise.
    fps: frames a second, where the format holds it.
    time_offset_s: how late the camera's clock is.
    from_centre: whether the principal point in K counts from the middle of the image.
    """

    name: str
    K: Float64[np.ndarray, "3 3"]
    distortion_model: str
    distortion: tuple[float, ...]
    world_from_cam: Float64[np.ndarray, "4 4"]
    width: int | None = None
    height: int | None = None
    files: tuple[str, ...] = ()
    masks: tuple[str, ...] = ()
    fps: float | None = None
    time_offset_s: float = 0.0
    from_centre: bool = False


@dataclass(frozen=True, eq=False)
class Calibration:
    """A network of cameras.

    upright: whether +Z of its world points up; else the world is the first camera's frame (OpenCV axes).
    notes: what its user should know, one sentence each.
    """

    cameras: tuple[CalibratedCamera, ...]
    upright: bool = True
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class CalibrationConfig(ABC):
    """Configuration of a member, chosen by its name: `calibration=colmap`."""

    members: ClassVar[str] = "aerojax.capture.imports.calibration.members"

    @abstractmethod
    def read(self, source: Path) -> Calibration:
        """Read a calibration.

        Raises:
            UserError: names the file and what is wrong with it.
        """
        ...


def transform_of(rotation: Float64[np.ndarray, "3 3"], translation: Float64[np.ndarray, "3"]) -> np.ndarray:
    """The 4×4 matrix [R t; 0 1]."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, translation
    return matrix


def intrinsics(fx: float, fy: float, cx: float, cy: float, pixel_centre: float) -> Float64[np.ndarray, "3 3"]:
    """K with the top-left pixel's centre at (0.5, 0.5).

    Args:
        fx, fy, cx, cy: pixels.
        pixel_centre: where the file puts that centre: 0.5, or 0 as OpenCV does.
    """
    shift = 0.5 - pixel_centre
    return np.array([[fx, 0.0, cx + shift], [0.0, fy, cy + shift], [0.0, 0.0, 1.0]])
