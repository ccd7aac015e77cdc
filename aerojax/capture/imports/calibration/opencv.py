"""Calibrations as OpenCV, ROS and others write them: one YAML or JSON file a camera, or one of several cameras.

OpenCV puts the centre of the top-left pixel at (0, 0), and R, t (or rvec, tvec) take the world to the camera.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np
from jaxtyping import Float64

from aerojax.capture.imports.calibration.base import (
    CalibratedCamera,
    Calibration,
    CalibrationConfig,
    intrinsics,
    transform_of,
)
from aerojax.capture.imports.calibration.documents import (
    files_in,
    first_of,
    mapping,
    needed,
    number,
    numbers,
    read_document,
    rigid,
    whole,
)
from aerojax.capture.lenses import COEFFICIENT_COUNTS
from aerojax.core.errors import UserError
from aerojax.geometry.cameras import invert_rigid

MATRIX = ("camera_matrix", "K", "cameraMatrix", "K-matrix", "K_matrix", "intrinsic_matrix", "intrinsics")
_COEFFICIENTS = ("distortion_coefficients", "dist_coeffs", "distCoeffs", "distCoeff", "D", "distortion", "dist")
_ROTATION = ("R", "rotation", "rotation_matrix", "rvec", "rotation_vector")
_TRANSLATION = ("t", "T", "tvec", "translation", "translation_vector")
_TRANSFORM = ("extrinsics", "extrinsic", "extrinsic_matrix", "transform")
_SIZE = (("image_width", "image_height"), ("width", "height"), ("w", "h"))
_SIZE_LISTS = ("image_size", "resolution", "imageSize")
_FISHEYE = ("equidistant", "fisheye", "opencv_fisheye", "kannala_brandt")

Extrinsics = Literal["cam_from_world", "world_from_cam"]


@dataclass(frozen=True)
class OpencvConfig(CalibrationConfig):
    """A file, or a folder with a file a camera, whose name is the camera's.

    pixel_centre: where the file has the centre of the top-left pixel.
    extrinsics: what R, t and the like are; keys named cam_from_world and world_from_cam say it themselves.
    """

    name: Literal["opencv"] = "opencv"
    pixel_centre: float = 0.0
    extrinsics: Extrinsics = "cam_from_world"

    def read(self, source: Path) -> Calibration:
        """Cameras in the order of files, and within a file as they stand there."""
        cameras = tuple(
            self.camera(name, document, f"{path}: {name}")
            for path in files_in(source)
            for name, document in _cameras_of(path)
        )
        return Calibration(cameras)

    def camera(self, name: str, document: Mapping[str, Any], where: str) -> CalibratedCamera:
        """One camera from its mapping."""
        lens = lens_of(document, where, self.pixel_centre)
        return CalibratedCamera(name=name, world_from_cam=self._pose(document, where), **lens)

    def _pose(self, document: Mapping[str, Any], where: str) -> Float64[np.ndarray, "4 4"]:
        for key in ("world_from_cam", "cam_from_world"):
            if document.get(key) is not None:
                pose = _matrix(document[key], f"{where}.{key}")
                return pose if key == "world_from_cam" else invert_rigid(pose)
        whole_transform = first_of(document, _TRANSFORM)
        if whole_transform is not None:
            pose = _matrix(whole_transform[1], f"{where}.{whole_transform[0]}")
        else:
            key, value = needed(document, _ROTATION, where)
            turn = numbers(value, f"{where}.{key}", 9, 3)
            rotation = turn.reshape(3, 3) if len(turn) == 9 else np.array(cv2.Rodrigues(turn)[0], np.float64)
            key, value = needed(document, _TRANSLATION, where)
            moved = numbers(value, f"{where}.{key}", 3)
            pose = rigid(transform_of(rotation, moved), where)
        return invert_rigid(pose) if self.extrinsics == "cam_from_world" else pose


def lens_of(document: Mapping[str, Any], where: str, pixel_centre: float) -> dict[str, Any]:
    """K, distortion and size of a camera's mapping, as keyword arguments of `CalibratedCamera`.

    Raises:
        UserError: a value is missing or none that there can be.
    """
    key, value = needed(document, MATRIX, where)
    matrix = numbers(value, f"{where}.{key}", 9).reshape(3, 3)
    if not matrix[2, 2] or matrix[0, 0] <= 0 or matrix[1, 1] <= 0:
        raise UserError("invalid", f"{where}.{key}: focal lengths must be positive", "is the matrix transposed?")
    matrix = matrix / matrix[2, 2]
    found = first_of(document, _COEFFICIENTS)
    coefficients = numbers(found[1], f"{where}.{found[0]}") if found else np.zeros(0)
    named = str(document.get("distortion_model", "fisheye" if document.get("fisheye_model") == 1 else "")).lower()
    model, values = _distortion(named in _FISHEYE, coefficients, where)
    K = intrinsics(matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2], pixel_centre)
    K[0, 1] = matrix[0, 1]
    width, height = size_of(document, where)
    return {"K": K, "distortion_model": model, "distortion": values, "width": width, "height": height}


def _distortion(fisheye: bool, values: np.ndarray, where: str) -> tuple[str, tuple[float, ...]]:
    model = "opencv_fisheye" if fisheye else "opencv"
    if not values.any() and not fisheye:
        return "none", ()
    counts = COEFFICIENT_COUNTS[model]
    if len(values) not in counts:
        wanted = " or ".join(map(str, counts))
        raise UserError("invalid", f"{where}: {len(values)} distortion coefficients, not {wanted}", "calibrate anew")
    return model, tuple(values.tolist())


def size_of(document: Mapping[str, Any], where: str) -> tuple[int | None, int | None]:
    """Width and height in pixels, None where the document does not say."""
    for wide, high in _SIZE:
        if document.get(wide) is not None and document.get(high) is not None:
            return whole(document[wide], f"{where}.{wide}"), whole(document[high], f"{where}.{high}")
    listed = first_of(document, _SIZE_LISTS)
    if listed is None:
        return None, None
    sides = numbers(listed[1], f"{where}.{listed[0]}", 2)
    return whole(sides[0], f"{where}.{listed[0]}"), whole(sides[1], f"{where}.{listed[0]}")


def _matrix(value: Any, where: str) -> Float64[np.ndarray, "4 4"]:
    rows = numbers(value, where, 16, 12).reshape(-1, 4)
    return rigid(np.vstack([rows[:3], [0.0, 0.0, 0.0, 1.0]]), where)


def _cameras_of(path: Path) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Names and mappings of the cameras in a file: one, a list, or one a key."""
    document = read_document(path)
    inner = document.get("cameras", document) if isinstance(document, Mapping) else document
    if isinstance(inner, list):
        for index, entry in enumerate(inner):
            camera = mapping(entry, f"{path}: cameras[{index}]")
            yield str(camera.get("name") or camera.get("camera_name") or f"cam_{index + 1:02d}"), camera
        return
    document = mapping(inner, str(path))
    if first_of(document, MATRIX) is not None:
        yield str(document.get("name") or path.stem), document
        return
    several = {str(name): one for name, one in document.items() if isinstance(one, Mapping) and first_of(one, MATRIX)}
    if not several:
        raise UserError("missing", f"{path}: has no {' or '.join(MATRIX)}", "is this a calibration of OpenCV?")
    yield from several.items()


def frame_rate(document: Mapping[str, Any], where: str) -> float | None:
    """`fps` of a camera's mapping, None without."""
    return number(document["fps"], f"{where}.fps") if document.get("fps") is not None else None
